//! Right-hand sides, some columns at a time and by front.

use rayon::prelude::*;

use crate::fronts::tree::Tree;
use crate::kernels::Real;
use crate::substitute::forward::{Active, Given, Slots};
use crate::substitute::solution::RightHandSides;

/// Some columns of `rhs`: at most 64 (one bit each in a word), `count` from `first` on.
#[derive(Clone, Copy)]
pub(crate) struct Columns<'a> {
    pub(crate) rhs: &'a RightHandSides,
    pub(crate) first: usize,
    pub(crate) count: usize,
}

impl<'a> Columns<'a> {
    /// The row of an unknown, `None` if it is zero.
    pub(crate) fn row(&self, unknown: usize) -> Option<&'a [f64]> {
        self.rhs.row(unknown).map(|row| &row[self.first..][..self.count])
    }

    /// The same by front.
    pub(crate) fn by_front(self, tree: &'a Tree) -> ColumnsByFront<'a> {
        let bits = |row: &[f64]| row.iter().rev().fold(0, |bits: u64, &value| bits << 1 | u64::from(value != 0.0));
        let unknowns = (0..self.rhs.size()).into_par_iter().with_min_len(1024);
        let nonzero = unknowns.map(|unknown| self.row(unknown).map_or(0, bits)).collect();
        ColumnsByFront { columns: self, tree, nonzero }
    }
}

/// Columns with a bit for each that is not zero, per unknown.
pub(crate) struct ColumnsByFront<'a> {
    columns: Columns<'a>,
    tree: &'a Tree,
    nonzero: Vec<u64>,
}

impl ColumnsByFront<'_> {
    fn unknowns(&self, front: usize) -> &[u32] {
        let front = &self.tree.fronts[front];
        &self.tree.order[front.start..front.start + front.columns]
    }
}

impl<R: Real> Given<R> for ColumnsByFront<'_> {
    fn mask(&self, front: usize) -> u64 {
        self.unknowns(front).iter().fold(0, |mask, &unknown| mask | self.nonzero[unknown as usize])
    }

    fn put(&self, front: usize, active: Active, y: &mut [R]) {
        let kept = Slots::of(active.columns());
        for (y, &unknown) in y.chunks_exact_mut(active.width).zip(self.unknowns(front)) {
            match self.columns.row(unknown as usize) {
                None => {}
                Some(row) if kept.len() == row.len() => y.iter_mut().zip(row).for_each(|(y, &x)| *y = R::of(x)),
                Some(row) => kept.iter().zip(y).for_each(|(&column, y)| *y = R::of(row[column])),
            }
        }
    }
}
