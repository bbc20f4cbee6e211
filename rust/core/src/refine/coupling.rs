//! Skin follows the lattice it hangs in, and the lattice follows its skin.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::local::Local;
use super::projection::Particle;

/// Moves skin by what its lattice nodes moved since `before` (the nodes' particles then), then by `share` of the way to its
/// place in the lattice, so that the two do not part.
pub(super) fn carry_skin(local: &mut Local, before: &[Particle], share: f32) {
    let (nodes, skin) = local.particles.split_at_mut(before.len());
    let (first, hung) = (before.len(), &local.region.hung);
    let of_run = |(run, skin): (usize, &mut [Particle])| {
        let first = first + run * RUN;
        let from = hung.partition_point(|hung| (hung.vertex as usize) < first);
        let to = hung.partition_point(|hung| (hung.vertex as usize) < first + RUN);
        for hung in &hung[from..to] {
            let (mut moved, mut held) = (Vec4::ZERO, Vec4::ZERO);
            for (&node, &share) in hung.nodes.iter().zip(&hung.shares) {
                let now = Vec4::from(nodes[node as usize]);
                moved += share * (now - Vec4::from(before[node as usize]));
                held += share * now;
            }
            let particle = &mut skin[hung.vertex as usize - first];
            shift(particle, moved.truncate());
            let away = held.truncate() - place(particle);
            shift(particle, away * share);
        }
    };
    skin.par_chunks_mut(RUN).enumerate().for_each(of_run);
}

/// Moves lattice nodes by the mean of what the skin around them moved since `before` (the skin's particles then).
pub(super) fn carry_lattice(local: &mut Local, before: &[Particle]) {
    let region = &local.region;
    let (nodes, skin) = local.particles.split_at_mut(region.nodes);
    let of_run = |(run, nodes): (usize, &mut [Particle])| {
        for (n, node) in nodes.iter_mut().enumerate() {
            let mut sum = Vec4::ZERO;
            for &(vertex, share) in region.hung_on(run * RUN + n) {
                let moved = Vec4::from(skin[vertex as usize]) - Vec4::from(before[vertex as usize]);
                // The fourth is the sum of the shares.
                sum += share * moved.truncate().extend(1.0);
            }
            if sum.w > 1e-6 {
                shift(node, sum.truncate() / sum.w);
            }
        }
    };
    nodes.par_chunks_mut(RUN).enumerate().for_each(of_run);
}

/// Particles that one task moves.
const RUN: usize = 2048;

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
