//! The inner side of a bend: skin in contact is a membrane that lies smoothly in the plane between the bones.

use std::collections::VecDeque;

use glam::Vec3;

use super::constraint::{Axis, HalfSpace, bind, self_collision};
use super::coupling::{place, shift};
use super::joints::Member;
use super::local::Local;

/// Skin within this many radii of a contact belongs to the membrane. A distance, not a number of edges: rings of a coarse
/// limb cost it a seventh of its volume.
const WIDTH: f32 = 0.3;
/// How far a pass moves the membrane towards the mean of its neighbours.
const SMOOTHING: f32 = 0.5;
/// In contact is what has come this near to the plane, in radii.
const TOUCH: f32 = 4e-4;

/// One bent joint in one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crease<'a> {
    pub(super) axis: Axis,
    pub(super) plane: HalfSpace,
    pub(super) radius: f32,
    /// Free particles of the joint, local.
    pub(super) members: &'a [Member],
}

impl Crease<'_> {
    /// Puts lattice and skin back on their own sides.
    pub(super) fn separate(&self, local: &mut Local) {
        for member in self.members.iter().filter(|member| member.side != 0.0) {
            let particle = &mut local.particles[member.particle as usize];
            let by = self_collision(&self.plane, place(particle), member.side);
            shift(particle, by);
        }
    }

    /// Skin in contact on the inner side of the bend.
    pub(super) fn contacts(&self, local: &Local, within: f32) -> Vec<u32> {
        let inwards = self.axis.directions[0] + self.axis.directions[1];
        let touches = |m: &&Member| {
            let at = place(&local.particles[m.particle as usize]);
            local.is_surface(m.particle)
                && m.side != 0.0
                && self.plane.depth(at, m.side) < within
                && (at - self.axis.origin).dot(inwards) > 0.0
        };
        self.members.iter().filter(touches).map(|member| member.particle).collect()
    }

    /// Passes of the membrane: towards the neighbours' mean, then back to the own side.
    pub(super) fn relax(&self, local: &mut Local, rest: &[Vec3], passes: usize) {
        for _ in 0..passes {
            let contacts = self.contacts(local, TOUCH * self.radius);
            if contacts.is_empty() {
                return;
            }
            let near = within(local, rest, &contacts, WIDTH * self.radius);
            smooth(local, &near, SMOOTHING);
            self.separate(local);
        }
    }
}

/// Puts the skin of a joint back to at most `most` times its distance from the bones at rest.
pub(super) fn bind_skin(local: &mut Local, axis: &Axis, members: &[Member], most: f32) {
    for member in members.iter().filter(|member| member.particle as usize >= local.nodes) {
        let particle = &mut local.particles[member.particle as usize];
        let by = bind(axis, place(particle), 0.0, most * member.distance);
        shift(particle, by);
    }
}

/// Free skin not farther from `seeds` along edges at rest than `distance`, seeds included, ascending.
pub(super) fn within(local: &Local, rest: &[Vec3], seeds: &[u32], distance: f32) -> Vec<u32> {
    let mut so_far = vec![f32::INFINITY; local.particles.len() - local.nodes];
    let mut queue: VecDeque<u32> = seeds.iter().copied().collect();
    seeds.iter().for_each(|&seed| so_far[seed as usize - local.nodes] = 0.0);
    let rest = |p: u32| rest[local.global[p as usize] as usize];
    while let Some(p) = queue.pop_front() {
        let here = so_far[p as usize - local.nodes];
        for &n in local.ring(p) {
            let there = here + rest(p).distance(rest(n));
            if there <= distance && there < so_far[n as usize - local.nodes] {
                so_far[n as usize - local.nodes] = there;
                queue.push_back(n);
            }
        }
    }
    let near = so_far.iter().enumerate().filter(|(_, d)| d.is_finite());
    near.map(|(i, _)| (i + local.nodes) as u32).filter(|&p| local.is_free(p)).collect()
}

/// `p_i = (1 - k) p_i + k (mean of the neighbours)`, all at once (Eq. 16).
pub(super) fn smooth(local: &mut Local, vertices: &[u32], k: f32) {
    let mean = |&p: &u32| {
        let ring = local.ring(p);
        let sum: Vec3 = ring.iter().map(|&n| place(&local.particles[n as usize])).sum();
        if ring.is_empty() { Vec3::ZERO } else { (sum / ring.len() as f32 - place(&local.particles[p as usize])) * k }
    };
    let moves: Vec<Vec3> = vertices.iter().map(mean).collect();
    vertices.iter().zip(moves).for_each(|(&p, by)| shift(&mut local.particles[p as usize], by));
}
