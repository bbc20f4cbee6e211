//! Extend-add: what a child passes on is added to its parent's front.

use std::ops::Range;

use pulp::Arch;

use crate::fronts::blocks::{BLOCK, FORK, middle_row};
use crate::kernels::{AddRuns, Run};

/// Adds the children's updates to the row blocks of the parent's update from `first` on.
pub(crate) fn add_children(update: &mut [&mut [f64]], first: usize, children: &[Child]) {
    if update.len() > 3 && BLOCK * BLOCK * update.len() * (first + update.len()) > FORK / 4 {
        let middle = middle_row(first, update.len(), usize::MAX);
        let (left, right) = update.split_at_mut(middle);
        rayon::join(|| add_children(left, first, children), || add_children(right, first + middle, children));
    } else {
        children.iter().for_each(|child| child.add_to_update(update, first));
    }
}

/// An update on its way into the parent's front.
pub(crate) struct Child<'a> {
    arch: Arch,
    /// Number of columns of the parent, and of rows of the update that are among them.
    columns: usize,
    inside: usize,
    /// Place of each row among the parent's columns and rows.
    in_parent: &'a [u32],
    /// Where each column starts in a row block of the parent: of its panel for the first `inside`, else of its update.
    starts: Vec<u32>,
    update: &'a [f64],
}

impl<'a> Child<'a> {
    pub(crate) fn new(arch: Arch, in_parent: &'a [u32], columns: usize, update: &'a [f64]) -> Self {
        let inside = in_parent.partition_point(|&place| (place as usize) < columns);
        let start =
            |&place: &u32| BLOCK as u32 * if (place as usize) < columns { place } else { place - columns as u32 };
        Self { arch, columns, inside, in_parent, starts: in_parent.iter().map(start).collect(), update }
    }

    /// Adds the columns that the parent eliminates to the row blocks of its panel.
    pub(crate) fn add_to_panel(&self, panel: &mut [&mut [f64]]) {
        let runs = self.runs(0..self.in_parent.len(), 0);
        let columns = &self.starts[..self.inside];
        self.arch.dispatch(AddRuns { update: self.update, runs: &runs, first: 0, columns, target: panel });
    }

    /// Adds the rest to the row blocks `target` of the parent's update, of which `first` is the first.
    fn add_to_update(&self, target: &mut [&mut [f64]], first: usize) {
        let row =
            |block: usize| self.in_parent.partition_point(|&place| (place as usize) < self.columns + BLOCK * block);
        let runs = self.runs(row(first)..row(first + target.len()), self.columns.div_ceil(BLOCK) + first);
        let columns = &self.starts[self.inside..];
        self.arch.dispatch(AddRuns { update: self.update, runs: &runs, first: self.inside, columns, target });
    }

    /// Splits `rows` of the update into runs; `first` is the parent's row block that counts as block 0.
    fn runs(&self, rows: Range<usize>, first: usize) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::with_capacity(rows.len() / 3);
        for row in rows {
            let (place, start) = (self.in_parent[row] as usize, self.starts[row] as usize / BLOCK);
            let above = if place < self.columns { 0 } else { self.columns.div_ceil(BLOCK) };
            let (block, lane) = (above + start / BLOCK - first, start % BLOCK);
            match runs.last_mut() {
                Some(run) if run.block == block && run.lane + run.count == lane && row % BLOCK != 0 => run.count += 1,
                _ => runs.push(Run { row, count: 1, block, lane }),
            }
        }
        runs
    }
}
