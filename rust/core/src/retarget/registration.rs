//! Optional: the warped target drawn onto the source by smooth displacements, so that other proportions match too.
//!
//! Each round finds the closest points p of the vertices z and moves these by the displacements d that minimise
//! `sum of m c |d - (p - z)|^2 + a l^2 <d, S d> + l^4 <d, S M^-1 S d>`, c being the confidence in each match, at a length l
//! that shrinks from round to round: first the limbs' lengths and girths agree, then smaller forms.

use glam::DVec3;

use super::matching::{Match, Matching};
use super::smooth::Smoother;
use crate::error::Result;
use crate::progress::Progress;

/// Smoothness lengths of the rounds, as shares of the source's size.
const LENGTHS: [f64; 7] = [0.15, 0.1, 0.075, 0.05, 0.035, 0.025, 0.015];
/// Weight of the first-order term beside the second-order one.
const MEMBRANE: f64 = 0.1;
/// Pull to the place a vertex has, as a share of a confident match: parts without any match stay.
const STAY: f64 = 1e-3;
/// Distance at which confidence falls to 1 / e, as a share of the source's size.
const TRUSTED: f64 = 0.04;

/// Moves `positions` (U), the vertices of a mesh of `triangles` (T), towards the source, whose diagonal is `size`.
///
/// # Errors
/// [`Error::Cancelled`](crate::Error::Cancelled), [`Error::NotPositiveDefinite`](crate::Error::NotPositiveDefinite).
pub fn register(
    matching: &Matching<'_>,
    triangles: &[[u32; 3]],
    positions: Vec<DVec3>,
    size: f64,
    progress: &Progress,
) -> Result<Vec<DVec3>> {
    let mut smoother = Smoother::new(&positions, triangles)?;
    let silent = Progress::default();
    let mut moved = positions;
    for (round, length) in LENGTHS.iter().enumerate() {
        progress.check()?;
        progress.report(0.1 + 0.6 * round as f64 / LENGTHS.len() as f64);
        let found = matching.closest(&moved)?.0;
        let pulls: Vec<(f64, DVec3)> = found.iter().zip(&moved).map(|(at, &z)| pull(at, z, TRUSTED * size)).collect();
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
