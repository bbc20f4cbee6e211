//! Forward substitution, from the leaves to the root.
//!
//! It carries only the columns that are not zero so far in a front's subtree: right-hand sides of inpainting live in a thin
//! band of unknowns, and those of short-ranged smoothing are mostly zero, so most subtrees see few of them.

use pulp::Arch;

use crate::fronts::blocks::BLOCK;
use crate::fronts::buffer::Buffer;
use crate::fronts::tree::{Front, Tree};
use crate::fronts::walk::{Plan, Received, Visit, walk};
use crate::kernels::{Apply, Forward, Real};
use crate::substitute::substitution::{FORK, PIVOT_BLOCKS, row_blocks};

/// Right-hand sides by front.
pub(crate) trait Given<R>: Sync {
    /// Which columns are not zero in the front's own unknowns, a bit each.
    fn mask(&self, front: usize) -> u64;

    /// Puts the rows of the front's own unknowns into `y` (columns of the front, width), which is zero.
    fn put(&self, front: usize, active: Active, y: &mut [R]);
}

/// The columns that are not zero in a subtree, in the order in which its fronts store them.
#[derive(Clone, Copy)]
pub(crate) struct Active {
    pub(crate) mask: u64,
    /// Number of columns stored, padding included.
    pub(crate) width: usize,
    /// Columns stored in their places, whether they are zero or not; 0 if it is those of the mask, without gaps.
    in_places: usize,
}

impl Active {
    /// Those of `mask`, without gaps, padded to whole cache lines.
    pub(crate) fn of<R: Real>(mask: u64) -> Self {
        Self { mask, width: (mask.count_ones() as usize).next_multiple_of(R::LINE), in_places: 0 }
    }

    /// The columns stored, ascending.
    pub(crate) fn columns(&self) -> impl Iterator<Item = usize> + use<> {
        let mut left = match self.in_places {
            0 => self.mask,
            count => u64::MAX >> (MOST_COLUMNS - count),
        };
        std::iter::from_fn(move || {
            let column = left.trailing_zeros() as usize;
            left &= left.wrapping_sub(1);
            (column < MOST_COLUMNS).then_some(column)
        })
    }

    /// Where `column` is stored.
    pub(crate) fn slot(&self, column: usize) -> usize {
        if self.in_places > 0 { column } else { (self.mask & ((1 << column) - 1)).count_ones() as usize }
    }

    /// Where the columns of `other`, which are among these, are stored.
    pub(crate) fn slots(&self, other: &Self) -> Slots {
        Slots::of(other.columns().map(|column| self.slot(column)))
    }
}

/// Columns that one pass can have: a bit each in a word.
pub const MOST_COLUMNS: usize = u64::BITS as usize;

/// A short list of columns or of their slots: there is one for nearly every front and pass.
pub(crate) struct Slots {
    slots: [usize; MOST_COLUMNS],
    count: usize,
}

impl Slots {
    pub(crate) fn of(list: impl Iterator<Item = usize>) -> Self {
        let mut slots = Self { slots: [0; MOST_COLUMNS], count: 0 };
        for slot in list {
            slots.slots[slots.count] = slot;
            slots.count += 1;
        }
        slots
    }
}

impl std::ops::Deref for Slots {
    type Target = [usize];

    fn deref(&self) -> &[usize] {
        &self.slots[..self.count]
    }
}

/// The columns that are not zero so far in each front's subtree, (fronts). Where those are nearly all of a `full` set of
/// columns (their number and width), all are stored.
pub(crate) fn activity<R: Real>(tree: &Tree, given: &impl Given<R>, full: Option<(usize, usize)>) -> Vec<Active> {
    let mut all: Vec<Active> = Vec::with_capacity(tree.fronts.len());
    for (index, front) in tree.fronts.iter().enumerate() {
        let mask = front.children.iter().fold(given.mask(index), |mask, &child| mask | all[child].mask);
        let mut active = Active::of::<R>(mask);
        if let Some((count, _)) = full.filter(|&(_, width)| width == active.width) {
            active.in_places = count;
        }
        all.push(active);
    }
    all
}

/// What fronts pass on to their parents.
#[derive(Debug)]
pub(crate) struct Stacks<R> {
    own: Option<Buffer<R>>,
    other: Option<Buffer<R>>,
}

impl<R> Default for Stacks<R> {
    fn default() -> Self {
        Self { own: None, other: None }
    }
}

/// Fills `x` in elimination order: (n, `full_width`), all zero before, or the `active` columns of each front, one after the
/// other.
#[allow(clippy::too_many_arguments)]
pub(crate) fn forward<R: Real>(
    tree: &Tree,
    panels: &[R],
    arch: Arch,
    given: &impl Given<R>,
    active: &[Active],
    full_width: Option<usize>,
    x: &mut [R],
    stacks: &mut Stacks<R>,
) {
    let mut panel_starts = Vec::with_capacity(tree.fronts.len());
    let mut subtree_store: Vec<usize> = Vec::with_capacity(tree.fronts.len());
    let mut start = 0;
    for (front, active) in tree.fronts.iter().zip(active) {
        panel_starts.push(start);
        start += front.panel_len();
        let below = front.children.iter().map(|&child| subtree_store[child]).sum::<usize>();
        subtree_store.push(below + front.columns * full_width.unwrap_or(active.width));
    }
    let plan = Plan::new(tree, |index| passed_len(&tree.fronts[index], &active[index]));
    let root = tree.root();
    let (own, other) = plan.stacks(root);
    let own = Buffer::at_least(&mut stacks.own, own);
    let other = Buffer::at_least(&mut stacks.other, other);
    let pass = ForwardPass { tree, panels, panel_starts, arch, given, active, full_width, subtree_store };
    let Ok(()) = walk(tree, &plan, &pass, root, x, own, other);
}

fn passed_len(front: &Front, active: &Active) -> usize {
    front.rows.len().next_multiple_of(BLOCK) * active.width
}

struct ForwardPass<'a, G, R> {
    tree: &'a Tree,
    panels: &'a [R],
    panel_starts: Vec<usize>,
    arch: Arch,
    given: &'a G,
    active: &'a [Active],
    full_width: Option<usize>,
    /// Length of the store of each front's subtree, (fronts).
    subtree_store: Vec<usize>,
}

impl<R: Real, G: Given<R>> Visit for ForwardPass<'_, G, R> {
    type Error = std::convert::Infallible;
    type Stored = R;
    type Passed = R;

    fn store_len(&self, index: usize) -> usize {
        self.tree.fronts[index].columns * self.full_width.unwrap_or(self.active[index].width)
    }

    fn subtree_store_len(&self, index: usize) -> usize {
        self.subtree_store[index]
    }

    fn passed_len(&self, index: usize) -> usize {
        passed_len(&self.tree.fronts[index], &self.active[index])
    }

    fn visit(&self, index: usize, x: &mut [R], passed: &mut [R], received: Received<R>) -> Result<(), Self::Error> {
        let (front, active) = (&self.tree.fronts[index], self.active[index]);
        if active.mask == 0 {
            return Ok(());
        }
        match self.full_width {
            Some(width) if width != active.width => {
                let mut y = vec![R::ZERO; front.columns * active.width];
                self.given.put(index, active, &mut y);
                self.front(index, &mut y, passed, &received);
                let kept = Slots::of(active.columns());
                for (x, y) in x.chunks_exact_mut(width).zip(y.chunks_exact(active.width)) {
                    kept.iter().zip(y).for_each(|(&column, &value)| x[column] = value);
                }
            }
            full => {
                if full.is_none() {
                    x.fill(R::ZERO);
                }
                self.given.put(index, active, x);
                self.front(index, x, passed, &received);
            }
        }
        Ok(())
    }
}

impl<R: Real, G: Given<R>> ForwardPass<'_, G, R> {
    fn front(&self, index: usize, y: &mut [R], passed: &mut [R], received: &Received<R>) {
        let (front, width) = (&self.tree.fronts[index], self.active[index].width);
        self.receive(index, received, |place| (place < front.columns).then_some(place), y);
        let blocks = row_blocks(&self.panels[self.panel_starts[index]..], front);
        let (triangle, lower) = blocks.split_at(front.columns.div_ceil(BLOCK));
        for first in (0..triangle.len()).step_by(PIVOT_BLOCKS) {
            let last = triangle.len().min(first + PIVOT_BLOCKS);
            let (done, now) = y.split_at_mut(BLOCK * first * width);
            let end = now.len().min(BLOCK * (last - first) * width);
            if first > 0 {
                apply(self.arch, &triangle[first..last], done, &mut now[..end], width, false);
            }
            let rest: Vec<&[R]> = triangle[first..last].iter().map(|row| &row[BLOCK * BLOCK * first..]).collect();
            self.arch.dispatch(Forward { rows: &rest, y: &mut now[..end], width });
        }
        if front.columns == 0 {
            passed.fill(R::ZERO);
        }
        apply(self.arch, lower, y, passed, width, true);
        self.receive(index, received, |place| place.checked_sub(front.columns), passed);
    }

    /// Adds what the children passed on to the rows of `target` that `row` gives for places in the front.
    fn receive(&self, index: usize, received: &Received<R>, row: impl Fn(usize) -> Option<usize>, target: &mut [R]) {
        let (front, active) = (&self.tree.fronts[index], &self.active[index]);
        for &child in &front.children {
            let (below, passing) = (&self.tree.fronts[child], &self.active[child]);
            if passing.mask == 0 {
                continue;
            }
            let slots = active.slots(passing);
            let values = received.from(child, passed_len(below, passing));
            for (values, &place) in values.chunks_exact(passing.width).zip(&below.in_parent) {
                let Some(row) = row(place as usize) else { continue };
                let target = &mut target[row * active.width..][..active.width];
                if passing.mask == active.mask || passing.in_places > 0 {
                    target.iter_mut().zip(values).for_each(|(target, &value)| *target += value);
                } else {
                    slots.iter().zip(values).for_each(|(&slot, &value)| target[slot] += value);
                }
            }
        }
    }
}

/// Subtracts (or stores the negative of) `rows * y`, on several threads where that pays.
fn apply<R: Real>(arch: Arch, rows: &[&[R]], y: &[R], target: &mut [R], width: usize, overwrite: bool) {
    if BLOCK * rows.len() * y.len() > FORK && rows.len() > 1 {
        let (above, below) = rows.split_at(rows.len() / 2);
        let (left, right) = target.split_at_mut(BLOCK * above.len() * width);
        rayon::join(
            || apply(arch, above, y, left, width, overwrite),
            || apply(arch, below, y, right, width, overwrite),
        );
    } else {
        arch.dispatch(Apply { rows, y, target, width, overwrite });
    }
}
