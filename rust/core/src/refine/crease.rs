//! The inner side of a bend: skin in contact is a membrane that lies smoothly in the plane between the bones.

use std::collections::VecDeque;

use super::constraint::{Axis, HalfSpace};
use super::coupling::place;
use super::joints::Member;
use super::local::Local;
use super::membrane::Membrane;

/// Skin within this many radii of a contact belongs to the membrane. A distance, not a number of edges: rings of a coarse
/// limb cost it a seventh of its volume.
const WIDTH: f32 = 0.4;
/// How far a pass moves the membrane towards the mean of its neighbours.
const SMOOTHING: f32 = 0.5;
/// And at most: the whole way there, neighbours swing to and fro.
const MOST_SMOOTHING: f32 = 0.9;
/// Edges up to this many radii are short.
const FINE: f32 = 0.4;
/// Edges shorter than this many radii take more passes, up to a limit.
const FINEST: f32 = 0.16;
const MOST_REPEATS: f32 = 4.0;
/// In contact is what has come this near to the plane, in radii: the lattice holds skin off the plane, and folds start
/// before it is there.
const TOUCH: f32 = 0.2;
/// A joint that bends by less than this (radians) has nothing in contact that does not touch, and no step shows where a
/// membrane ends; from the other one on it is as wide as it gets.
const SLIGHT: f32 = 0.17;
const BENT: f32 = 0.79;

/// One bent joint in one step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crease<'a> {
    pub(super) axis: Axis,
    pub(super) plane: HalfSpace,
    pub(super) radius: f32,
    /// Where the joint bends to at last, radians.
    pub(super) swing: f32,
    /// Free particles of the joint, local.
    pub(super) members: &'a [Member],
}

impl Crease<'_> {
    /// Lattice nodes, then skin.
    fn parts(&self, local: &Local) -> (&[Member], &[Member]) {
        self.members.split_at(self.members.partition_point(|m| (m.particle as usize) < local.nodes))
    }

    /// Skin in contact on the inner side of the bend.
    pub(super) fn contacts(&self, local: &Local, within: f32) -> Vec<u32> {
        let inwards = self.axis.directions[0] + self.axis.directions[1];
        let touches = |m: &&Member| {
            let at = place(&local.particles[m.particle as usize]);
            self.plane.depth(at, m.side) < within && (at - self.axis.origin).dot(inwards) > 0.0
        };
        self.parts(local).1.iter().filter(touches).map(|member| member.particle).collect()
    }

    /// How far a pass smooths, and how many passes stand for one. Each takes a larger part of the limb away the longer its
    /// edges are beside the radius; and the shorter they are, the less far it reaches.
    fn fineness(&self, local: &Local, vertices: &[u32]) -> (f32, usize) {
        let lengths = vertices.iter().flat_map(|&p| local.ring_lengths(p));
        let (sum, count) = lengths.fold((0.0, 0), |(sum, count), length| (sum + length, count + 1));
        let edge = (sum / count.max(1) as f32).max(1e-6) / self.radius;
        let smoothing = SMOOTHING * (FINE / edge).powi(2).min(1.0);
        // Two short moves are as good as one of twice the length.
        let wanted = (FINEST / edge).powi(2).round().clamp(1.0, MOST_REPEATS);
        let repeats = (wanted / 2.0).ceil();
        ((smoothing * wanted / repeats).min(MOST_SMOOTHING), repeats as usize)
    }

    /// The skin in contact and what lies near it, if any is.
    pub(super) fn membrane(&self, local: &Local) -> Option<Membrane> {
        let bend = ((self.swing - SLIGHT) / (BENT - SLIGHT)).clamp(0.0, 1.0);
        let contacts = self.contacts(local, TOUCH * bend * self.radius);
        if contacts.is_empty() {
            return None;
        }
        let near = within(local, &contacts, WIDTH * self.radius);
        let (smoothing, repeats) = self.fineness(local, &contacts);
        Some(Membrane::new(local, &near, self.parts(local).1, smoothing, repeats))
    }
}

/// Free skin not farther from `seeds` along edges at rest than `distance`, seeds included, ascending.
pub(super) fn within(local: &Local, seeds: &[u32], distance: f32) -> Vec<u32> {
    let mut so_far = vec![f32::INFINITY; local.particles.len() - local.nodes];
    let mut queue: VecDeque<u32> = seeds.iter().copied().collect();
    seeds.iter().for_each(|&seed| so_far[seed as usize - local.nodes] = 0.0);
    while let Some(p) = queue.pop_front() {
        let here = so_far[p as usize - local.nodes];
        for (&n, &length) in local.ring(p).iter().zip(local.ring_lengths(p)) {
            let there = here + length;
            if there <= distance && there < so_far[n as usize - local.nodes] {
                so_far[n as usize - local.nodes] = there;
                queue.push_back(n);
            }
        }
    }
    let near = so_far.iter().enumerate().filter(|(_, d)| d.is_finite());
    near.map(|(i, _)| (i + local.nodes) as u32).filter(|&p| local.is_free(p)).collect()
}
