//! What the two ways of substitution through the tree share, forward from the leaves and backward from the root.

use rayon::prelude::*;

use crate::fronts::blocks::{BLOCK, panel_len};
use crate::fronts::tree::Front;
use crate::substitute::solution::RightHandSides;

/// Work of a front (multiplications) worth a second thread.
pub(crate) const FORK: usize = 1 << 19;
/// Row blocks solved on one thread before the rest makes use of them.
pub(crate) const PIVOT_BLOCKS: usize = 16;

/// Some columns of `rhs`: at most 64 (one bit each in a word), `count` from `first` on.
#[derive(Clone, Copy)]
pub(crate) struct Columns<'a> {
    pub(crate) rhs: &'a RightHandSides,
    pub(crate) first: usize,
    pub(crate) count: usize,
    /// `count` padded to whole vectors.
    pub(crate) width: usize,
}

impl<'a> Columns<'a> {
    /// The row of an unknown, `None` if it is zero.
    pub(crate) fn row(&self, unknown: usize) -> Option<&'a [f64]> {
        self.rhs.row(unknown).map(|row| &row[self.first..][..self.count])
    }

    /// Which of the columns are not zero, per unknown.
    pub(crate) fn nonzero(&self) -> Vec<u64> {
        let bits = |row: &[f64]| row.iter().rev().fold(0, |bits: u64, &value| bits << 1 | u64::from(value != 0.0));
        let unknowns = (0..self.rhs.size()).into_par_iter().with_min_len(1024);
        unknowns.map(|unknown| self.row(unknown).map_or(0, bits)).collect()
    }
}

/// The row blocks of the panel at the start of `panels`, those of its triangle first.
pub(crate) fn row_blocks<'a>(panels: &'a [f64], front: &Front) -> Vec<&'a [f64]> {
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
