//! Tetrahedra that a bend has turned inside out.

use rayon::prelude::*;

use super::super::constraint::volume;
use super::batch::{Batch, Particle};

/// Tetrahedra that one task looks at.
const RUN: usize = 2048;

/// Projects the constraints of tetrahedra that have less than `least` of the volume `at_rest` towards `target` of it, one
/// by one, `passes` times over those that stay so thin; then looks for others, `rounds` times in all.
///
/// The sweeps converge slowly where a bend turns tetrahedra inside out; there are few of them.
pub fn untangle(
    batch: &Batch<4, 0>,
    at_rest: f32,
    particles: &mut [Particle],
    [least, target]: [f32; 2],
    passes: usize,
    rounds: usize,
) {
    let corners = |k: usize| [0, 1, 2, 3].map(|n| batch.particles[n][k] as usize);
    let value = |particles: &[Particle], k: usize, share: f32| {
        let places = corners(k).map(|p| [particles[p][0], particles[p][1], particles[p][2]]);
        volume(places, share * at_rest)
    };
    for _ in 0..rounds {
        let thin = |&k: &usize| value(particles, k, least).value < 0.0;
        let mut left: Vec<usize> = (0..batch.len()).into_par_iter().with_min_len(RUN).filter(thin).collect();
        if left.is_empty() {
            return;
        }
        for _ in 0..passes {
            for &k in &left {
                let at = corners(k);
                let step = value(particles, k, target).project(at.map(|p| particles[p][3]), 0.0, 0.0);
                for (p, by) in at.into_iter().zip(step.moves) {
                    (0..3).for_each(|c| particles[p][c] += by[c]);
                }
            }
            left.retain(|&k| value(particles, k, least).value < 0.0);
        }
    }
}
