//! What a system is solved for, and the answer: many columns side by side.

use rayon::prelude::*;

use crate::fronts::buffer::Buffer;

const ABSENT: u32 = u32::MAX;

/// Right-hand sides (n, columns). Rows of zeros need no memory: those of inpainting fill a thin band of unknowns.
#[derive(Debug, Clone)]
pub struct RightHandSides {
    pub(crate) columns: usize,
    /// Which of the stored rows is that of each unknown, (n).
    stored: Vec<u32>,
    values: Vec<f64>,
}

impl RightHandSides {
    /// All of them, `values` (n, columns) row-major.
    pub fn dense(n: usize, columns: usize, values: Vec<f64>) -> Self {
        debug_assert_eq!(values.len(), n * columns);
        Self { columns, stored: (0..n as u32).collect(), values }
    }

    /// `values` (rows, columns) row-major for the distinct unknowns `rows`, zero for the others of `n`.
    pub fn sparse(n: usize, columns: usize, rows: &[u32], values: Vec<f64>) -> Self {
        debug_assert_eq!(values.len(), rows.len() * columns);
        let mut stored = vec![ABSENT; n];
        rows.iter().zip(0..).for_each(|(&unknown, row)| stored[unknown as usize] = row);
        Self { columns, stored, values }
    }

    /// Number of unknowns.
    pub(crate) fn size(&self) -> usize {
        self.stored.len()
    }

    /// The row of an unknown, `None` if it is zero.
    pub(crate) fn row(&self, unknown: usize) -> Option<&[f64]> {
        let row = self.stored[unknown];
        (row != ABSENT).then(|| &self.values[row as usize * self.columns..][..self.columns])
    }
}

/// Solutions (n, columns), in memory in the order in which the factor eliminates the unknowns.
#[derive(Debug)]
pub struct Solution<'f> {
    /// Place of each unknown in that order; `None` where it is the unknowns' own.
    pub(crate) place: Option<&'f [u32]>,
    pub(crate) parts: Vec<Part>,
    pub(crate) residual: f64,
}

/// Some of the columns: `values` is (n, width), of which the first `count` columns mean something.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) values: Buffer,
    pub(crate) width: usize,
    pub(crate) count: usize,
}

impl Solution<'_> {
    /// The solutions for one unknown, (columns).
    pub fn row(&self, unknown: usize) -> impl Iterator<Item = f64> + '_ {
        let place = self.place.map_or(unknown, |place| place[unknown] as usize);
        self.parts.iter().flat_map(move |part| &part.values[place * part.width..][..part.count]).copied()
    }

    /// The sum of all columns times their `factors`, for one unknown.
    pub(crate) fn combined(&self, unknown: usize, factors: &[f64]) -> f64 {
        let place = self.place.map_or(unknown, |place| place[unknown] as usize);
        let (mut sum, mut factors) = (0.0, factors);
        for part in &self.parts {
            let (now, later) = factors.split_at(part.count);
            sum += part.values[place * part.width..].iter().zip(now).map(|(x, factor)| x * factor).sum::<f64>();
            factors = later;
        }
        sum
    }

    /// Normwise backward error `|r| / (|A| |x| + |b|)` (maximum norms) of one pseudo-random combination of the columns: it
    /// costs one product and sees an error in any column.
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// Adds another solution of the same factor.
    pub(crate) fn add(&mut self, other: &Self) {
        for (part, other) in self.parts.iter_mut().zip(&other.parts) {
            part.values.par_iter_mut().zip(&*other.values).with_min_len(4096).for_each(|(x, y)| *x += y);
        }
    }
}
