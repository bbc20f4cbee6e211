//! Tetrahedra that a bend has turned inside out.

use rayon::prelude::*;

use super::super::constraint::volume;
use super::batch::{Batch, Multipliers, Particle};
use super::kind::Fill;
use super::{Kernel, project};

/// Tetrahedra that one task looks at.
const RUN: usize = 4096;

/// Brings tetrahedra that have less than `least` of the volume `at_rest` up to `target` of it, `passes` times over them;
/// then looks for others, `rounds` times in all.
///
/// The sweeps converge slowly where a bend turns tetrahedra inside out; there are few of them.
pub fn untangle(
    kernel: Kernel,
    batch: &Batch<4, 0>,
    at_rest: f32,
    particles: &mut [Particle],
    [least, target]: [f32; 2],
    passes: usize,
    rounds: usize,
) {
    for _ in 0..rounds {
        let thin = batch.subset(&thin(batch, particles, least * at_rest));
        if thin.is_empty() {
            return;
        }
        for _ in 0..passes {
            project(kernel, Fill(target * at_rest), &thin, &mut Multipliers::new(0), particles);
        }
    }
}

/// The tetrahedra with a volume of less than `least`, ascending.
fn thin(batch: &Batch<4, 0>, particles: &[Particle], least: f32) -> Vec<u32> {
    let [a, b, c, d] = &batch.particles;
    let of_run = |run: usize| {
        let of_one = |k: usize| {
            let places = [a[k], b[k], c[k], d[k]].map(|p| {
                let [x, y, z, _] = particles[p as usize];
                [x, y, z]
            });
            volume(places, least).value
        };
        let end = ((run + 1) * RUN).min(batch.len());
        (run * RUN..end).filter(|&k| of_one(k) < 0.0).map(|k| k as u32).collect::<Vec<_>>()
    };
    (0..batch.len().div_ceil(RUN)).into_par_iter().flat_map_iter(of_run).collect()
}
