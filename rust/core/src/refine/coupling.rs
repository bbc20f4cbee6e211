//! Skin follows the lattice it hangs in, and the lattice follows its skin.

use glam::Vec3;
use rayon::prelude::*;

use super::joints::Member;
use super::local::Local;
use super::projection::Particle;

/// Moves skin by what its lattice nodes moved since `before` (the nodes' particles then).
pub(super) fn carry_skin(local: &mut Local, before: &[Particle]) {
    for hung in &local.region.hung {
        let mut moved = Vec3::ZERO;
        for (&node, &share) in hung.nodes.iter().zip(&hung.shares) {
            moved += share * (place(&local.particles[node as usize]) - place(&before[node as usize]));
        }
        shift(&mut local.particles[hung.vertex as usize], moved);
    }
}

/// Moves lattice nodes by the mean of what the skin around them moved since `before` (the skin's particles then).
pub(super) fn carry_lattice(local: &mut Local, before: &[Particle]) {
    let mut sums = vec![(Vec3::ZERO, 0.0f32); local.nodes];
    for hung in &local.region.hung {
        let vertex = hung.vertex as usize;
        let moved = place(&local.particles[vertex]) - place(&before[vertex - local.nodes]);
        for (&node, &share) in hung.nodes.iter().zip(&hung.shares) {
            let sum = &mut sums[node as usize];
            (sum.0, sum.1) = (sum.0 + share * moved, sum.1 + share);
        }
    }
    for (node, (moved, share)) in sums.into_iter().enumerate() {
        if share > 1e-6 {
            shift(&mut local.particles[node], moved / share);
        }
    }
}

/// Pulls skin back to its place in the lattice by `share` of the way, so that the two do not part.
pub(super) fn rejoin(local: &mut Local, share: f32) {
    for hung in &local.region.hung {
        let nodes = hung.nodes.iter().zip(&hung.shares);
        let held: Vec3 = nodes.map(|(&node, &b)| b * place(&local.particles[node as usize])).sum();
        let away = held - place(&local.particles[hung.vertex as usize]);
        shift(&mut local.particles[hung.vertex as usize], away * share);
    }
}

/// Particles that one task moves.
const RUN: usize = 2048;

/// Moves each of `members` (ascending) by what `by` says of its place, if it is free.
pub(super) fn shift_members(
    particles: &mut [Particle],
    members: &[Member],
    by: impl Fn(Vec3, &Member) -> Vec3 + Sync,
) {
    let of_run = |(run, particles): (usize, &mut [Particle])| {
        let first = run * RUN;
        let from = members.partition_point(|m| (m.particle as usize) < first);
        let to = members.partition_point(|m| (m.particle as usize) < first + RUN);
        for member in &members[from..to] {
            let particle = &mut particles[member.particle as usize - first];
            let by = by(place(particle), member);
            shift(particle, by);
        }
    };
    particles.par_chunks_mut(RUN).enumerate().for_each(of_run);
}

pub(super) fn place(particle: &Particle) -> Vec3 {
    Vec3::new(particle[0], particle[1], particle[2])
}

/// Moves a particle if it is free.
pub(super) fn shift(particle: &mut Particle, by: Vec3) {
    if particle[3] > 0.0 {
        particle[0] += by.x;
        particle[1] += by.y;
        particle[2] += by.z;
    }
}
