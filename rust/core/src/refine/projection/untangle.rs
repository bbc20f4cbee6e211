//! Tetrahedra that a bend has turned inside out.

use rayon::prelude::*;

use super::batch::{Batch, Multipliers, Particle};
use super::kind::{Fill, Thin};
use super::look::look;
use super::{Kernel, project};

/// Tetrahedra that one task looks at.
const RUN: usize = 4096;

/// Rounds among what lies around the first thin tetrahedra, until all are looked at again.
const NEAR: usize = 8;

/// Brings tetrahedra that have less than `least` of the volume `at_rest` up to `target` of it, `passes` times over them.
///
/// The sweeps converge slowly where a bend turns tetrahedra inside out; there are few of them.
pub fn fill(
    kernel: Kernel,
    batch: &Batch<4, 0>,
    at_rest: f32,
    particles: &mut [Particle],
    [least, target]: [f32; 2],
    passes: usize,
) {
    let thin = batch.subset(&thin(kernel, batch, particles, least * at_rest));
    for _ in 0..passes {
        project(kernel, Fill(target * at_rest), &thin, &mut Multipliers::new(0), particles);
    }
}

/// The same again and again, up to `rounds` times or until none is thin: filling one makes neighbours thin, so that many
/// rounds of few passes leave fewer than the other way round.
pub fn untangle(
    kernel: Kernel,
    batch: &Batch<4, 0>,
    at_rest: f32,
    particles: &mut [Particle],
    limits: [f32; 2],
    passes: usize,
    rounds: usize,
) {
    for _ in 0..rounds.div_ceil(NEAR) {
        let first = thin(kernel, batch, particles, limits[0] * at_rest);
        if first.is_empty() {
            return;
        }
        let near = batch.subset(&around(batch, &first, particles.len()));
        for _ in 0..NEAR.min(rounds) {
            fill(kernel, &near, at_rest, particles, limits, passes);
        }
    }
}

/// Tetrahedra that share a corner with those that share a corner with `some`, ascending.
fn around(batch: &Batch<4, 0>, some: &[u32], particle_count: usize) -> Vec<u32> {
    let mut is_near = vec![false; particle_count];
    some.iter().for_each(|&k| batch.particles.iter().for_each(|column| is_near[column[k as usize] as usize] = true));
    let shares = |is_near: &[bool], k: usize| batch.particles.iter().any(|column| is_near[column[k] as usize]);
    let next: Vec<usize> = (0..batch.len()).filter(|&k| shares(&is_near, k)).collect();
    next.iter().for_each(|&k| batch.particles.iter().for_each(|column| is_near[column[k] as usize] = true));
    (0..batch.len()).filter(|&k| shares(&is_near, k)).map(|k| k as u32).collect()
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
