//! Tetrahedra that a bend has turned inside out.

use rayon::prelude::*;

use super::batch::{Batch, Multipliers, Particle};
use super::kind::{Fill, Thin};
use super::look::look;
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
        let thin = batch.subset(&thin(kernel, batch, particles, least * at_rest));
        if thin.is_empty() {
            return;
        }
        for _ in 0..passes {
            project(kernel, Fill(target * at_rest), &thin, &mut Multipliers::new(0), particles);
        }
    }
}

/// The tetrahedra with a volume of less than `least`, ascending.
fn thin(kernel: Kernel, batch: &Batch<4, 0>, particles: &[Particle], least: f32) -> Vec<u32> {
    let of_run = |run: usize| {
        let (from, to) = (run * RUN, ((run + 1) * RUN).min(batch.len()));
        let mut thin = Vec::new();
        look(kernel, Thin(least), batch, from..to, particles, |k| thin.push(k as u32));
        thin
    };
    (0..batch.len().div_ceil(RUN)).into_par_iter().flat_map_iter(of_run).collect()
}
