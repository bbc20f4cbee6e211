//! Forward and backward substitution through the tree, all right-hand sides at once.
//!
//! The forward pass carries only the columns that are not zero so far in a front's subtree: right-hand sides of inpainting
//! live in a thin band of unknowns, so most subtrees see few of them. The backward pass is dense.

use pulp::Arch;
use rayon::prelude::*;

use super::blocks::{BLOCK, panel_len};
use super::buffer::Buffer;
use super::kernels::{Apply, Backward, Forward};
use super::tree::{Front, Tree};
use super::walk::{Plan, Received, Visit, walk};

/// Work of a front (multiplications) worth a second thread.
const FORK: usize = 1 << 19;
/// Subtrees with more columns than this are shared between threads on the way down.
const FORK_COLUMNS: usize = 1000;
/// Row blocks solved on one thread before the rest makes use of them.
const PIVOT_BLOCKS: usize = 16;
/// Row blocks the backward pass reads side by side, a block column at a time: as many as the hardware prefetches.
const STREAMS: usize = 8;

/// Solves for some right-hand sides; `x` (n, width) is filled in elimination order.
pub(super) fn solve(tree: &Tree, panels: &[f64], arch: Arch, columns: Columns, x: &mut [f64]) {
    forward(tree, panels, arch, columns, x);
    backward(tree, panels, arch, columns.width, x);
}

/// Some right-hand sides out of `rhs` (n, columns): at most 64 (one bit each in a word), `count` from `first` on.
#[derive(Clone, Copy)]
pub(super) struct Columns<'a> {
    pub(super) rhs: &'a [f64],
    pub(super) columns: usize,
    pub(super) first: usize,
    pub(super) count: usize,
    /// `count` padded to whole vectors.
    pub(super) width: usize,
}

impl<'a> Columns<'a> {
    pub(super) fn row(&self, unknown: usize) -> &'a [f64] {
        &self.rhs[unknown * self.columns + self.first..][..self.count]
    }

    /// The first column that is not zero, unless it is not finite.
    pub(super) fn nonzero_column(&self) -> Option<usize> {
        let rows = 0..self.rhs.len() / self.columns;
        let column = rows.clone().find_map(|unknown| self.row(unknown).iter().position(|&value| value != 0.0))?;
        rows.map(|unknown| self.row(unknown)[column]).all(f64::is_finite).then_some(column)
    }

    /// Which of the columns are not zero, per unknown.
    fn nonzero(&self) -> Vec<u64> {
        let bits = |unknown| {
            let row = self.row(unknown);
            row.iter().rev().fold(0, |bits: u64, &value| bits << 1 | u64::from(value != 0.0))
        };
        (0..self.rhs.len() / self.columns).into_par_iter().with_min_len(1024).map(bits).collect()
    }
}

/// The columns that are not zero in a subtree, in the order in which its fronts store them.
#[derive(Clone, Copy)]
struct Active {
    mask: u64,
    /// Number of columns stored, padding included.
    width: usize,
}

impl Active {
    /// All columns are stored, in their places.
    fn is_full(&self, columns: &Columns) -> bool {
        self.width == columns.width
    }

    /// The columns stored.
    fn columns(&self, columns: &Columns) -> Vec<usize> {
        if self.is_full(columns) {
            return (0..columns.count).collect();
        }
        (0..columns.count).filter(|column| self.mask >> column & 1 == 1).collect()
    }

    /// Where `column` is stored.
    fn slot(&self, columns: &Columns, column: usize) -> usize {
        if self.is_full(columns) { column } else { (self.mask & ((1 << column) - 1)).count_ones() as usize }
    }
}

fn forward(tree: &Tree, panels: &[f64], arch: Arch, columns: Columns, x: &mut [f64]) {
    let nonzero = columns.nonzero();
    let mut active: Vec<Active> = Vec::with_capacity(tree.fronts.len());
    let mut panel_starts = Vec::with_capacity(tree.fronts.len());
    let mut start = 0;
    for front in &tree.fronts {
        let own = tree.order[front.start..front.start + front.columns].iter().map(|&i| nonzero[i as usize]);
        let mask = own.chain(front.children.iter().map(|&child| active[child].mask)).fold(0, |all, mask| all | mask);
        active.push(Active { mask, width: (mask.count_ones() as usize).next_multiple_of(BLOCK) });
        panel_starts.push(start);
        start += front.panel_len();
    }
    let plan = Plan::new(tree, |index| passed_len(&tree.fronts[index], &active[index]));
    let root = tree.root();
    let (own, other) = plan.stacks(root);
    let (mut own, mut other) = (Buffer::zeroed(own), Buffer::zeroed(other));
    let pass = ForwardPass { tree, panels, panel_starts, arch, columns, active };
    let Ok(()) = walk(tree, &plan, &pass, root, x, &mut own, &mut other);
}

fn passed_len(front: &Front, active: &Active) -> usize {
    front.rows.len().next_multiple_of(BLOCK) * active.width
}

struct ForwardPass<'a> {
    tree: &'a Tree,
    panels: &'a [f64],
    panel_starts: Vec<usize>,
    arch: Arch,
    columns: Columns<'a>,
    active: Vec<Active>,
}

impl Visit for ForwardPass<'_> {
    type Error = std::convert::Infallible;

    fn store_len(&self, front: &Front) -> usize {
        front.columns * self.columns.width
    }

    fn subtree_store_len(&self, front: &Front) -> usize {
        front.subtree_columns * self.columns.width
    }

    fn passed_len(&self, index: usize) -> usize {
        passed_len(&self.tree.fronts[index], &self.active[index])
    }

    fn visit(&self, index: usize, x: &mut [f64], passed: &mut [f64], received: Received) -> Result<(), Self::Error> {
        let (front, active) = (&self.tree.fronts[index], self.active[index]);
        if active.mask == 0 {
            x.fill(0.0);
            return Ok(());
        }
        let kept = active.columns(&self.columns);
        if active.is_full(&self.columns) {
            self.gather(front, &kept, active.width, x);
            self.front(index, x, passed, &received);
        } else {
            let mut y = vec![0.0; front.columns * active.width];
            self.gather(front, &kept, active.width, &mut y);
            self.front(index, &mut y, passed, &received);
            x.fill(0.0);
            for (x, y) in x.chunks_exact_mut(self.columns.width).zip(y.chunks_exact(active.width)) {
                kept.iter().zip(y).for_each(|(&column, &value)| x[column] = value);
            }
        }
        Ok(())
    }
}

impl ForwardPass<'_> {
    /// Fills `y` (columns of the front, width) with the right-hand side.
    fn gather(&self, front: &Front, kept: &[usize], width: usize, y: &mut [f64]) {
        let unknowns = &self.tree.order[front.start..front.start + front.columns];
        for (y, &unknown) in y.chunks_exact_mut(width).zip(unknowns) {
            let row = self.columns.row(unknown as usize);
            if kept.len() == row.len() {
                y[..row.len()].copy_from_slice(row);
                y[row.len()..].fill(0.0);
            } else {
                kept.iter().zip(y).for_each(|(&column, y)| *y = row[column]);
            }
        }
    }

    fn front(&self, index: usize, y: &mut [f64], passed: &mut [f64], received: &Received) {
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
            let rest: Vec<&[f64]> = triangle[first..last].iter().map(|row| &row[BLOCK * BLOCK * first..]).collect();
            self.arch.dispatch(Forward { rows: &rest, y: &mut now[..end], width });
        }
        if front.columns == 0 {
            passed.fill(0.0);
        }
        apply(self.arch, lower, y, passed, width, true);
        self.receive(index, received, |place| place.checked_sub(front.columns), passed);
    }

    /// Adds what the children passed on to the rows of `target` that `row` gives for places in the front.
    fn receive(&self, index: usize, received: &Received, row: impl Fn(usize) -> Option<usize>, target: &mut [f64]) {
        let (front, active) = (&self.tree.fronts[index], &self.active[index]);
        for &child in &front.children {
            let (below, passing) = (&self.tree.fronts[child], &self.active[child]);
            if passing.mask == 0 {
                continue;
            }
            let slots: Vec<usize> =
                passing.columns(&self.columns).iter().map(|&column| active.slot(&self.columns, column)).collect();
            let values = received.from(child, passed_len(below, passing));
            for (values, &place) in values.chunks_exact(passing.width).zip(&below.in_parent) {
                let Some(row) = row(place as usize) else { continue };
                let target = &mut target[row * active.width..][..active.width];
                if passing.mask == active.mask || passing.is_full(&self.columns) {
                    target.iter_mut().zip(values).for_each(|(target, value)| *target += value);
                } else {
                    slots.iter().zip(values).for_each(|(&slot, value)| target[slot] += value);
                }
            }
        }
    }
}

/// Subtracts (or stores the negative of) `rows * y`, on several threads where that pays.
fn apply(arch: Arch, rows: &[&[f64]], y: &[f64], target: &mut [f64], width: usize, overwrite: bool) {
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

/// The row blocks of the panel at the start of `panels`, those of its triangle first.
fn row_blocks<'a>(panels: &'a [f64], front: &Front) -> Vec<&'a [f64]> {
    let k = front.columns;
    let mut panel = &panels[..panel_len(k, front.rows.len())];
    let mut blocks = Vec::with_capacity(k.div_ceil(BLOCK) + front.rows.len().div_ceil(BLOCK));
    for start in (0..k).step_by(BLOCK) {
        let (block, rest) = panel.split_at(BLOCK * k.min(start + BLOCK));
        blocks.push(block);
        panel = rest;
    }
    blocks.extend(panel.chunks_exact((BLOCK * k).max(1)));
    blocks
}

fn backward(tree: &Tree, panels: &[f64], arch: Arch, width: usize, x: &mut [f64]) {
    let mut space = vec![0; tree.fronts.len()];
    for (index, front) in tree.fronts.iter().enumerate() {
        let needs = front.children.iter().map(|&child| boundary_len(&tree.fronts[child], width) + space[child]);
        space[index] = if forks(front) { needs.sum() } else { needs.max().unwrap_or(0) };
    }
    let root = tree.root();
    let mut work = Buffer::zeroed(space[root]);
    let panels = &panels[..tree.fronts[root].subtree_panels];
    BackwardPass { tree, arch, width, space }.descend(root, panels, x, &[], &mut work);
}

fn forks(front: &Front) -> bool {
    front.children.len() > 1 && front.subtree_columns > FORK_COLUMNS
}

/// Length of the solution in the rows under a front's columns.
fn boundary_len(front: &Front, width: usize) -> usize {
    front.rows.len().next_multiple_of(BLOCK) * width
}

struct BackwardPass<'a> {
    tree: &'a Tree,
    arch: Arch,
    width: usize,
    /// Work space for the children of each front.
    space: Vec<usize>,
}

impl BackwardPass<'_> {
    /// Solves the subtree of `root` given the solution in the root's rows.
    fn descend(&self, root: usize, panels: &[f64], x: &mut [f64], boundary: &[f64], work: &mut [f64]) {
        let front = &self.tree.fronts[root];
        let (below, own) = x.split_at_mut(x.len() - front.columns * self.width);
        let (panels, panel) = panels.split_at(panels.len() - front.panel_len());
        self.solve_front(front, panel, own, boundary);
        self.descend_children(&front.children, panels, below, &Solved { front, own, boundary }, work);
    }

    fn descend_children(&self, roots: &[usize], panels: &[f64], x: &mut [f64], parent: &Solved, work: &mut [f64]) {
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
                if forks(parent.front) {
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

    /// Solves for `own` (columns, width) given the solution in the rows under them.
    fn solve_front(&self, front: &Front, panel: &[f64], own: &mut [f64], boundary: &[f64]) {
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
    fn subtract_later(&self, rows: &[&[f64]], x: &[f64], block: usize, y: &mut [f64]) {
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
struct Solved<'a> {
    front: &'a Front,
    own: &'a [f64],
    boundary: &'a [f64],
}

impl Solved<'_> {
    /// Copies the solution in the rows of `child` to `target`.
    fn gather(&self, child: &Front, width: usize, target: &mut [f64]) {
        for (target, &place) in target.chunks_exact_mut(width).zip(&child.in_parent) {
            let source = match (place as usize).checked_sub(self.front.columns) {
                None => &self.own[place as usize * width..],
                Some(row) => &self.boundary[row * width..],
            };
            target.copy_from_slice(&source[..width]);
        }
        target[child.rows.len() * width..].fill(0.0);
    }
}
