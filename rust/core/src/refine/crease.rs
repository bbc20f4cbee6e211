//! The inner side of a bend: skin in contact is a membrane that lies smoothly in the plane between the bones.

use std::collections::VecDeque;

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::constraint::{Axis, HalfSpace, bind, self_collision};
use super::coupling::{place, shift, shift_members};
use super::joints::Member;
use super::local::Local;

/// Skin within this many radii of a contact belongs to the membrane. A distance, not a number of edges: rings of a coarse
/// limb cost it a seventh of its volume.
const WIDTH: f32 = 0.4;
/// How far a pass moves the membrane towards the mean of its neighbours.
const SMOOTHING: f32 = 0.5;
/// Edges up to this many radii are short.
const FINE: f32 = 0.4;
/// Edges shorter than this many radii take more passes, up to a limit.
const FINEST: f32 = 0.16;
const MOST_REPEATS: f32 = 4.0;
/// Vertices that one task smooths.
const RUN: usize = 512;
/// In contact is what has come this near to the plane, in radii: the lattice holds skin off the plane, and folds start
/// before it is there.
const TOUCH: f32 = 0.2;

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
        self.separate_some(local, self.members);
    }

    fn separate_some(&self, local: &mut Local, members: &[Member]) {
        let nodes = local.nodes;
        shift_members(&mut local.particles, members, |at, member| {
            if member.side != 0.0 {
                self_collision(&self.plane, at, member.side)
            } else if member.particle as usize >= nodes {
                // Skin that lies in the plane at rest stays between the two sides.
                let height = (at - self.plane.origin).dot(self.plane.normal);
                let within = height.clamp(-self.plane.gap / 2.0, self.plane.gap / 2.0);
                self.plane.normal * (within - height)
            } else {
                Vec3::ZERO
            }
        });
    }

    /// Skin in contact on the inner side of the bend.
    pub(super) fn contacts(&self, local: &Local, within: f32) -> Vec<u32> {
        let inwards = self.axis.directions[0] + self.axis.directions[1];
        let touches = |m: &&Member| {
            let at = place(&local.particles[m.particle as usize]);
            local.is_surface(m.particle)
                && self.plane.depth(at, m.side) < within
                && (at - self.axis.origin).dot(inwards) > 0.0
        };
        self.members.iter().filter(touches).map(|member| member.particle).collect()
    }

    /// How far a pass smooths, and how many passes stand for one. Each takes a larger part of the limb away the longer its
    /// edges are beside the radius; and the shorter they are, the less far it reaches.
    fn fineness(&self, local: &Local, rest: &[Vec3], vertices: &[u32]) -> (f32, usize) {
        let place = |p: u32| rest[local.global[p as usize] as usize];
        let lengths = vertices.iter().flat_map(|&p| local.ring(p).iter().map(move |&n| place(p).distance(place(n))));
        let (sum, count) = lengths.fold((0.0, 0), |(sum, count), length| (sum + length, count + 1));
        let edge = (sum / count.max(1) as f32).max(1e-6) / self.radius;
        let repeats = (FINEST / edge).powi(2).round().clamp(1.0, MOST_REPEATS);
        (SMOOTHING * (FINE / edge).powi(2).min(1.0), repeats as usize)
    }

    /// Passes of the membrane: towards the neighbours' mean, then back to the own side. Returns its vertices.
    pub(super) fn relax(&self, local: &mut Local, rest: &[Vec3], passes: usize) -> Vec<u32> {
        let contacts = self.contacts(local, TOUCH * self.radius);
        if contacts.is_empty() {
            return contacts;
        }
        let near = within(local, rest, &contacts, WIDTH * self.radius);
        let members: Vec<Member> = {
            let is_near = |m: &&Member| near.binary_search(&m.particle).is_ok();
            let first = self.members.partition_point(|m| (m.particle as usize) < local.nodes);
            self.members[first..].iter().filter(is_near).copied().collect()
        };
        let (smoothing, repeats) = self.fineness(local, rest, &contacts);
        for _ in 0..passes * repeats {
            smooth(local, &near, smoothing);
            self.separate_some(local, &members);
        }
        self.separate(local);
        near
    }
}

/// Puts the skin of a joint back to at most `most` times its distance from the bones at rest.
pub(super) fn bind_skin(local: &mut Local, axis: &Axis, members: &[Member], most: f32) {
    let first = members.partition_point(|m| (m.particle as usize) < local.nodes);
    let limit = |at: Vec3, member: &Member| bind(axis, at, 0.0, most * member.distance);
    shift_members(&mut local.particles, &members[first..], limit);
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
        let sum: Vec4 = ring.iter().map(|&n| Vec4::from(local.particles[n as usize])).sum();
        let away = sum / ring.len() as f32 - Vec4::from(local.particles[p as usize]);
        if ring.is_empty() { Vec3::ZERO } else { away.truncate() * k }
    };
    let moves: Vec<Vec3> = vertices.par_iter().with_min_len(RUN).map(mean).collect();
    vertices.iter().zip(moves).for_each(|(&p, by)| shift(&mut local.particles[p as usize], by));
}
