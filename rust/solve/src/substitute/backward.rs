//! Backward substitution, from the root to the leaves; dense (see `sparse` for the other).

use pulp::Arch;

use crate::fronts::blocks::BLOCK;
use crate::fronts::buffer::Buffer;
use crate::fronts::tree::{Front, Tree};
use crate::fronts::walk::BRANCHES;
use crate::kernels::{Backward, Real};
use crate::substitute::substitution::{FORK, PIVOT_BLOCKS, row_blocks};

/// Subtrees with more columns than this are divided between threads, unless there are [`BRANCHES`] larger ones for each.
const FORK_COLUMNS: usize = 1000;
/// Row blocks read side by side, a block column at a time: as many as the hardware prefetches.
const STREAMS: usize = 4;

/// Solves for `x` (n, width) in place, in elimination order.
pub(crate) fn backward<R: Real>(tree: &Tree, panels: &[R], arch: Arch, width: usize, x: &mut [R]) {
    let fork = FORK_COLUMNS.max(tree.order.len() / (BRANCHES * rayon::current_num_threads()));
    let mut space = vec![0; tree.fronts.len()];
    for (index, front) in tree.fronts.iter().enumerate() {
        let needs = front.children.iter().map(|&child| boundary_len(&tree.fronts[child], width) + space[child]);
        space[index] = if forks(front, fork) { needs.sum() } else { needs.max().unwrap_or(0) };
    }
    let root = tree.root();
    let mut work = Buffer::zeroed(space[root]);
    let panels = &panels[..tree.fronts[root].subtree_panels];
    BackwardPass { tree, arithmetic: Arithmetic { arch, width }, width, space, fork }.descend(
        root,
        panels,
        x,
        &[],
        &mut work,
    );
}

fn forks(front: &Front, columns: usize) -> bool {
    front.children.len() > 1 && front.subtree_columns > columns
}

/// Length of the solution in the rows under a front's columns.
fn boundary_len(front: &Front, width: usize) -> usize {
    front.rows.len().next_multiple_of(BLOCK) * width
}

struct BackwardPass<'a> {
    tree: &'a Tree,
    arithmetic: Arithmetic,
    width: usize,
    /// Work space for the children of each front.
    space: Vec<usize>,
    /// Columns of a subtree from which on it is divided between threads.
    fork: usize,
}

impl BackwardPass<'_> {
    /// Solves the subtree of `root` given the solution in the root's rows.
    fn descend<R: Real>(&self, root: usize, panels: &[R], x: &mut [R], boundary: &[R], work: &mut [R]) {
        let front = &self.tree.fronts[root];
        let (below, own) = x.split_at_mut(x.len() - front.columns * self.width);
        let (panels, panel) = panels.split_at(panels.len() - front.panel_len());
        self.arithmetic.solve_front(front, panel, own, boundary);
        self.descend_children(&front.children, panels, below, &Solved { front, own, boundary }, work);
    }

    fn descend_children<R: Real>(
        &self,
        roots: &[usize],
        panels: &[R],
        x: &mut [R],
        parent: &Solved<R>,
        work: &mut [R],
    ) {
        let sum = |roots: &[usize], of: &dyn Fn(usize) -> usize| roots.iter().map(|&root| of(root)).sum::<usize>();
        match roots {
            [] => {}
            &[root] => {
                let front = &self.tree.fronts[root];
                let (boundary, work) = work.split_at_mut(boundary_len(front, self.width));
                parent.gather(front, self.width, boundary);
                self.descend(root, panels, x, boundary, work);
            }
            _ => {
                let (left, right) = roots.split_at(roots.len() / 2);
                let (panels_left, panels_right) =
                    panels.split_at(sum(left, &|root| self.tree.fronts[root].subtree_panels));
                let (x_left, x_right) =
                    x.split_at_mut(sum(left, &|root| self.tree.fronts[root].subtree_columns) * self.width);
                if forks(parent.front, self.fork) {
                    let space = |root: usize| boundary_len(&self.tree.fronts[root], self.width) + self.space[root];
                    let (work_left, work_right) = work.split_at_mut(sum(left, &space));
                    rayon::join(
                        || self.descend_children(left, panels_left, x_left, parent, work_left),
                        || self.descend_children(right, panels_right, x_right, parent, work_right),
                    );
                } else {
                    self.descend_children(left, panels_left, x_left, parent, work);
                    self.descend_children(right, panels_right, x_right, parent, work);
                }
            }
        }
    }
}

/// What is done to each front, `width` columns wide.
pub(crate) struct Arithmetic {
    pub(crate) arch: Arch,
    pub(crate) width: usize,
}

impl Arithmetic {
    /// Solves for `own` (columns, width) given the solution in the rows under them.
    pub(crate) fn solve_front<R: Real>(&self, front: &Front, panel: &[R], own: &mut [R], boundary: &[R]) {
        let blocks = row_blocks(panel, front);
        let (triangle, lower) = blocks.split_at(front.columns.div_ceil(BLOCK));
        self.subtract_later(lower, boundary, 0, own);
        for first in (0..triangle.len()).step_by(PIVOT_BLOCKS).rev() {
            let last = triangle.len().min(first + PIVOT_BLOCKS);
            let end = own.len().min(BLOCK * last * self.width);
            let (before, after) = own.split_at_mut(end);
            if !after.is_empty() {
                self.subtract_later(&triangle[last..], after, first, &mut before[BLOCK * first * self.width..]);
            }
            for block in (first..last).rev() {
                let (now, later) = before[BLOCK * block * self.width..]
                    .split_at_mut((BLOCK * self.width).min(end - BLOCK * block * self.width));
                self.arch.dispatch(Backward {
                    rows: &triangle[block + 1..last],
                    x: later,
                    block,
                    y: now,
                    width: self.width,
                    pivots: Some(&triangle[block][BLOCK * BLOCK * block..]),
                });
            }
        }
    }

    /// Subtracts the transposed product of `rows` with their solution `x` from the row blocks `y`, the first of which is
    /// block column `block`.
    fn subtract_later<R: Real>(&self, rows: &[&[R]], x: &[R], block: usize, y: &mut [R]) {
        if rows.is_empty() || y.is_empty() {
            return;
        }
        let blocks = y.len().div_ceil(BLOCK * self.width);
        if BLOCK * rows.len() * y.len() > FORK && blocks > 1 {
            let (left, right) = y.split_at_mut(BLOCK * (blocks / 2) * self.width);
            rayon::join(
                || self.subtract_later(rows, x, block, left),
                || self.subtract_later(rows, x, block + blocks / 2, right),
            );
        } else {
            let streams = rows.len().div_ceil(rows.len().div_ceil(STREAMS));
            for (rows, x) in rows.chunks(streams).zip(x.chunks(streams * BLOCK * self.width)) {
                for (offset, y) in y.chunks_mut(BLOCK * self.width).enumerate() {
                    let block = block + offset;
                    self.arch.dispatch(Backward { rows, x, block, y, width: self.width, pivots: None });
                }
            }
        }
    }
}

/// A front whose solution is known.
struct Solved<'a, R> {
    front: &'a Front,
    own: &'a [R],
    boundary: &'a [R],
}

impl<R: Real> Solved<'_, R> {
    /// Copies the solution in the rows of `child` to `target`.
    fn gather(&self, child: &Front, width: usize, target: &mut [R]) {
        for (target, &place) in target.chunks_exact_mut(width).zip(&child.in_parent) {
            let source = match (place as usize).checked_sub(self.front.columns) {
                None => &self.own[place as usize * width..],
                Some(row) => &self.boundary[row * width..],
            };
            target.copy_from_slice(&source[..width]);
        }
        target[child.rows.len() * width..].fill(R::ZERO);
    }
}
