//! Unreliable rows filled, then smoothing and the limit.

use rayon::prelude::*;

use super::Settings;
use super::rows::{Row, normalise};
use crate::error::Result;
use crate::fill::{Constraint, Fill};
use crate::progress::Progress;
use crate::weights::Weights;
use crate::welded::Welded;

/// Smoothness length of the filling, as a share of the target's diagonal.
const SMOOTHNESS: f64 = 0.05;
/// Shares of a row below this are rounding noise beside the f32 that stores them, and are dropped.
const NEGLIGIBLE: f64 = 1e-7;

/// Rows of all distinct positions (U) of a target.
#[derive(Debug)]
pub(super) struct Finish<'a> {
    target: &'a Welded,
    rows: Vec<Row>,
    reliable: &'a [bool],
    /// Neighbours along edges, for smoothing.
    fill: Fill,
}

impl<'a> Finish<'a> {
    /// Fills the rows that are not `reliable` from those around them. Islands without a reliable row keep what they have.
    pub fn new(rows: Vec<Row>, reliable: &'a [bool], target: &'a Welded, diagonal: f64) -> Result<Self> {
        let positions = target.positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let mut fill = Fill::new(positions, target.triangles.clone(), None)?;
        let silent = Progress::default();
        if reliable.iter().any(|reliable| !reliable) {
            let constraints = reliable.iter().map(|&r| if r { Constraint::Fixed } else { Constraint::Free }).collect();
            let assembled = fill.assemble(constraints, SMOOTHNESS * diagonal, &silent)?;
            fill.factor(assembled, &silent)?;
        }
        Ok(Self { target, rows, reliable, fill })
    }

    /// The weights of every vertex (V) over `n_bones` bones.
    ///
    /// # Errors
    /// Those of [`Fill::solve`].
    pub fn weights(mut self, n_bones: u32, settings: &Settings, progress: &Progress) -> Result<Weights> {
        if self.reliable.iter().any(|reliable| !reliable) {
            self.rows = self.filled(progress)?;
        }
        for _ in 0..settings.smoothing_iterations {
            self.rows = self.smoothed(settings.smoothing_factor);
        }
        let limited: Vec<Row> = self.rows.into_par_iter().map(|row| limited(row, settings.max_influences)).collect();
        let of_vertex = &self.target.of_vertex;
        Ok(Weights::from_rows(
            of_vertex.len(),
            n_bones,
            || (),
            |(), i, out| {
                out.extend(limited[of_vertex[i] as usize].iter().map(|&(bone, value)| (bone, value as f32)));
            },
        ))
    }

    fn filled(&self, progress: &Progress) -> Result<Vec<Row>> {
        let given = |i: u32, row: &mut Row| row.extend(&self.rows[i as usize]);
        let filled = self.fill.solve(&given, progress)?;
        let row = |i: usize| {
            let mut row = Row::new();
            if filled.is_solved(i) {
                filled.append_row(i, &mut row);
                normalise(&mut row);
            }
            if row.is_empty() { self.rows[i].clone() } else { row }
        };
        Ok((0..self.rows.len()).into_par_iter().map(row).collect())
    }

    /// One pass over the unreliable rows and those beside them. Empty rows stay empty and count for nothing.
    fn smoothed(&self, factor: f64) -> Vec<Row> {
        let neighbours = |i: usize| self.fill.laplacian().neighbours(i);
        let row = |i: usize| {
            let beside = !self.reliable[i] || neighbours(i).iter().any(|&j| !self.reliable[j as usize]);
            let mut row = self.rows[i].clone();
            if beside && !row.is_empty() {
                row.iter_mut().for_each(|(_, value)| *value *= 1.0 - factor);
                let share = factor / neighbours(i).len().max(1) as f64;
                for &j in neighbours(i) {
                    row.extend(self.rows[j as usize].iter().map(|&(bone, value)| (bone, share * value)));
                }
                normalise(&mut row);
            }
            row
        };
        (0..self.rows.len()).into_par_iter().map(row).collect()
    }
}

/// Without noise, and the largest `count` influences only (ties: the lower bone) unless `count` is 0.
fn limited(mut row: Row, count: usize) -> Row {
    row.retain(|&(_, value)| value > NEGLIGIBLE);
    if count > 0 && row.len() > count {
        row.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
        row.truncate(count);
    }
    normalise(&mut row);
    row
}
