//! The way through the elimination tree, children before parents, with work space for what children pass on.

use crate::fronts::tree::{Front, Tree};

/// Subtrees with more multiplications than this are divided between threads, unless there are so many larger ones that
/// each thread has this number to choose from: each branch has work space of its own, and touching memory for the first
/// time costs as much as the arithmetic.
const FORK: f64 = 2e6;
pub(crate) const BRANCHES: usize = 8;

/// What a walk does at each front.
pub(crate) trait Visit: Sync {
    /// Why a visit may fail.
    type Error: Send;
    /// Numbers of the store, and those that are passed on.
    type Stored: Send;
    type Passed: Send + Sync;

    /// Length of the front's own stretch of the store.
    fn store_len(&self, index: usize) -> usize;

    /// Length of the stores of a whole subtree.
    fn subtree_store_len(&self, index: usize) -> usize;

    /// Length of what the front passes on to its parent.
    fn passed_len(&self, index: usize) -> usize;

    /// Handles a front: `store` is its own, `passed` is to be filled, `received` holds what each child passed on.
    fn visit(
        &self,
        index: usize,
        store: &mut [Self::Stored],
        passed: &mut [Self::Passed],
        received: Received<Self::Passed>,
    ) -> Result<(), Self::Error>;
}

/// What the children of a front have passed on.
pub(crate) struct Received<'a, T> {
    plan: &'a Plan,
    space: &'a [T],
}

impl<'a, T> Received<'a, T> {
    /// What `child` has passed on.
    pub(crate) fn from(&self, child: usize, len: usize) -> &'a [T] {
        &self.space[self.plan.offset[child]..][..len]
    }
}

/// Two stacks hold what is passed on, one for every other level of the tree, so that a front writes its own at the
/// bottom of one stack while it reads its children's from the other, and nothing is ever moved.
pub(crate) struct Plan {
    /// Space a subtree needs in the stack of its root, and in the other one.
    own: Vec<usize>,
    other: Vec<usize>,
    /// Where a front's share begins in the space its parent gives to its children.
    offset: Vec<usize>,
    /// Multiplications of a subtree from which on it is divided between threads.
    fork: f64,
}

impl Plan {
    pub(crate) fn new(tree: &Tree, passed_len: impl Fn(usize) -> usize) -> Self {
        let n = tree.fronts.len();
        let branches = (BRANCHES * rayon::current_num_threads()) as f64;
        let fork = FORK.max(tree.fronts[tree.root()].subtree_flops / branches);
        let mut plan = Self { own: vec![0; n], other: vec![0; n], offset: vec![0; n], fork };
        for (index, front) in tree.fronts.iter().enumerate() {
            let (mut own, mut other, mut offset) = (0, 0, 0);
            for &child in &front.children {
                plan.offset[child] = offset;
                other = other.max(offset + plan.own[child]);
                if plan.forks(front) {
                    offset += plan.own[child];
                    own += plan.other[child];
                } else {
                    offset += passed_len(child);
                    own = own.max(plan.other[child]);
                }
            }
            plan.own[index] = own.max(passed_len(index));
            plan.other[index] = other;
        }
        plan
    }

    fn forks(&self, front: &Front) -> bool {
        front.children.len() > 1 && front.subtree_flops > self.fork
    }

    /// Lengths of the two stacks.
    pub(crate) fn stacks(&self, root: usize) -> (usize, usize) {
        (self.own[root], self.other[root])
    }
}

/// Visits the subtree of `root`. `store` is the subtree's; `own` and `other` are the two stacks.
pub(crate) fn walk<V: Visit>(
    tree: &Tree,
    plan: &Plan,
    visitor: &V,
    root: usize,
    store: &mut [V::Stored],
    own: &mut [V::Passed],
    other: &mut [V::Passed],
) -> Result<(), V::Error> {
    let front = &tree.fronts[root];
    let (below, store) = store.split_at_mut(store.len() - visitor.store_len(root));
    if plan.forks(front) {
        walk_apart(tree, plan, visitor, &front.children, below, other, own)?;
    } else {
        let mut below = below;
        for &child in &front.children {
            let (child_store, rest) = below.split_at_mut(visitor.subtree_store_len(child));
            walk(tree, plan, visitor, child, child_store, &mut other[plan.offset[child]..], own)?;
            below = rest;
        }
    }
    let passed = &mut own[..visitor.passed_len(root)];
    visitor.visit(root, store, passed, Received { plan, space: other })
}

/// Visits neighbouring subtrees on as many threads as there are.
fn walk_apart<V: Visit>(
    tree: &Tree,
    plan: &Plan,
    visitor: &V,
    roots: &[usize],
    store: &mut [V::Stored],
    own: &mut [V::Passed],
    other: &mut [V::Passed],
) -> Result<(), V::Error> {
    match roots {
        [] => Ok(()),
        &[root] => walk(tree, plan, visitor, root, store, own, other),
        _ => {
            let (left, right) = roots.split_at(roots.len() / 2);
            let sum = |of: &dyn Fn(usize) -> usize| left.iter().map(|&root| of(root)).sum::<usize>();
            let (store_left, store_right) = store.split_at_mut(sum(&|root| visitor.subtree_store_len(root)));
            let (own_left, own_right) = own.split_at_mut(sum(&|root| plan.own[root]));
            let (other_left, other_right) = other.split_at_mut(sum(&|root| plan.other[root]));
            let (left, right) = rayon::join(
                || walk_apart(tree, plan, visitor, left, store_left, own_left, other_left),
                || walk_apart(tree, plan, visitor, right, store_right, own_right, other_right),
            );
            left.and(right)
        }
    }
}
