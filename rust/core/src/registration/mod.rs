//! One surface drawn onto another by smooth displacements, so that places on both correspond.
//!
//! Each round finds the closest points p of the vertices z, by position and normal, and moves these by the displacements d that
//! minimise `sum of m c |d - (p - z)|^2 + a l^2 <d, S d> + l^4 <d, S M^-1 S d>`, c being the confidence in each match, at a
//! length l that shrinks from round to round: first the limbs' lengths and girths agree, then smaller forms.

mod matching;
mod smooth;

use glam::DVec3;

pub use matching::MatchPoints;
pub(crate) use matching::{Lengths, Match, Matching};
use smooth::Smoother;

use crate::error::Result;
use crate::progress::Progress;

/// The rounds of a registration, as shares of the fixed surface's size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Schedule<'a> {
    /// Smoothness length of each round.
    pub lengths: &'a [f64],
    /// Distance at which confidence in a match falls to 1 / e.
    pub trusted: f64,
}

/// Weight of the first-order term beside the second-order one.
const MEMBRANE: f64 = 0.1;
/// Pull to the place a vertex has, as a share of a confident match: parts without any match stay.
const STAY: f64 = 1e-3;
/// Moves `positions` (U), the vertices of a mesh of `triangles` (T), towards the fixed surface, whose diagonal is `size`.
/// Reports progress from `span.0` to `span.1`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled), [`Error::NotPositiveDefinite`](crate::Error::NotPositiveDefinite).
pub(crate) fn register(
    matching: &Matching<'_>,
    triangles: &[[u32; 3]],
    positions: Vec<DVec3>,
    size: f64,
    schedule: Schedule<'_>,
    (progress, span): (&Progress, (f64, f64)),
) -> Result<Vec<DVec3>> {
    let mut smoother = Smoother::new(&positions, triangles)?;
    let silent = Progress::default();
    let mut moved = positions;
    for (round, length) in schedule.lengths.iter().enumerate() {
        progress.check()?;
        progress.report(span.0 + (span.1 - span.0) * round as f64 / schedule.lengths.len() as f64);
        let found = matching.closest(&moved)?.0;
        let pulls: Vec<(f64, DVec3)> =
            found.iter().zip(&moved).map(|(at, &z)| pull(at, z, schedule.trusted * size)).collect();
        let confidence: Vec<f64> = pulls.iter().map(|(c, _)| c + STAY).collect();
        let wanted: Vec<DVec3> = pulls.iter().map(|(c, d)| *c / (c + STAY) * *d).collect();
        smoother.set_bending(&confidence, length * size, MEMBRANE, &silent)?;
        moved.iter_mut().zip(smoother.smooth(&wanted, &silent)?).for_each(|(z, d)| *z += d);
    }
    Ok(moved)
}

/// Confidence and displacement of a match of a vertex at `z`.
fn pull(at: &Match, z: DVec3, trusted: f64) -> (f64, DVec3) {
    let displacement = at.position - z;
    let far = displacement.length() / trusted;
    (at.cosine.max(0.0).powi(2) * (-far * far).exp(), displacement)
}
