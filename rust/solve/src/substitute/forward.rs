//! Forward substitution, from the leaves to the root.
//!
//! It carries only the columns that are not zero so far in a front's subtree: right-hand sides of inpainting live in a thin
//! band of unknowns, so most subtrees see few of them.

use pulp::Arch;

use crate::fronts::blocks::BLOCK;
use crate::fronts::buffer::Buffer;
use crate::fronts::tree::{Front, Tree};
use crate::fronts::walk::{Plan, Received, Visit, walk};
use crate::kernels::{Apply, Forward};
use crate::substitute::substitution::{Columns, FORK, PIVOT_BLOCKS, row_blocks};

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

/// Fills `x` (n, width), all zero, in elimination order. Returns whether each front's subtree has anything but zeros, (fronts).
pub(crate) fn forward(tree: &Tree, panels: &[f64], arch: Arch, columns: Columns, x: &mut [f64]) -> Vec<bool> {
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
    pass.active.iter().map(|active| active.mask != 0).collect()
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
            for (x, y) in x.chunks_exact_mut(self.columns.width).zip(y.chunks_exact(active.width)) {
                kept.iter().zip(y).for_each(|(&column, &value)| x[column] = value);
            }
        }
        Ok(())
    }
}

impl ForwardPass<'_> {
    /// Puts the right-hand side into `y` (columns of the front, width), which is zero.
    fn gather(&self, front: &Front, kept: &[usize], width: usize, y: &mut [f64]) {
        let unknowns = &self.tree.order[front.start..front.start + front.columns];
        for (y, &unknown) in y.chunks_exact_mut(width).zip(unknowns) {
            match self.columns.row(unknown as usize) {
                None => {}
                Some(row) if kept.len() == row.len() => y[..row.len()].copy_from_slice(row),
                Some(row) => kept.iter().zip(y).for_each(|(&column, y)| *y = row[column]),
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
