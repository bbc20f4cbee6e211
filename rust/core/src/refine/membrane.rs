//! Skin in a crease, copied close together: dozens of passes go over a few thousand vertices.

use glam::{Vec3, Vec4};

use super::constraint::HalfSpace;
use super::joints::Member;
use super::local::Local;

/// Vertices that move, then those around them, with the neighbours of the first.
pub(super) struct Membrane {
    places: Vec<Vec4>,
    /// The places after the pass under way.
    next: Vec<Vec4>,
    starts: Vec<u32>,
    rings: Vec<u32>,
    /// Lowest and highest that each may be above the plane.
    heights: Vec<[f32; 2]>,
    /// The particles of the first.
    moving: Vec<u32>,
}

impl Membrane {
    /// Of the vertices `moving`, ascending.
    pub(super) fn new(local: &Local, moving: &[u32]) -> Self {
        // All that have equally many neighbours one after the other: loops of one length are predicted.
        let mut moving = moving.to_vec();
        moving.sort_by_key(|&p| local.ring(p).len());
        let mut number = vec![u32::MAX; local.particles.len() - local.nodes];
        moving.iter().enumerate().for_each(|(k, &p)| number[p as usize - local.nodes] = k as u32);
        let mut all = moving.clone();
        let (mut starts, mut rings) = (vec![0], Vec::with_capacity(moving.len() * 7));
        for &p in &moving {
            for &n in local.ring(p) {
                let number = &mut number[n as usize - local.nodes];
                if *number == u32::MAX {
                    *number = all.len() as u32;
                    all.push(n);
                }
                rings.push(*number);
            }
            starts.push(rings.len() as u32);
        }
        let places: Vec<Vec4> = all.iter().map(|&p| Vec4::from(local.particles[p as usize])).collect();
        Self { next: places.clone(), places, starts, rings, heights: vec![HalfSpace::ANYWHERE; moving.len()], moving }
    }

    /// Keeps those that are among `members` (ascending) on their own sides.
    pub(super) fn hold(&mut self, plane: &HalfSpace, members: &[Member]) {
        for (heights, &p) in self.heights.iter_mut().zip(&self.moving) {
            if let Ok(k) = members.binary_search_by_key(&p, |member| member.particle) {
                *heights = plane.heights(members[k].side);
            }
        }
    }

    /// Writes the places of what moved.
    pub(super) fn put_back(&self, local: &mut Local) {
        for (&p, place) in self.moving.iter().zip(&self.places) {
            let particle = &mut local.particles[p as usize];
            [particle[0], particle[1], particle[2]] = place.truncate().to_array();
        }
    }

    /// `p_i = (1 - k) p_i + k (mean of the neighbours)`, all at once (Eq. 16), then back to the own side of the plane.
    pub(super) fn pass(&mut self, plane: &HalfSpace, k: f32) {
        let rings = self.starts.windows(2).map(|ends| &self.rings[ends[0] as usize..ends[1] as usize]);
        let moving = self.next.iter_mut().zip(&self.places).zip(&self.heights);
        for (((next, &here), heights), ring) in moving.zip(rings) {
            let sum: Vec4 = ring.iter().map(|&n| self.places[n as usize]).sum();
            let by = if ring.is_empty() { Vec3::ZERO } else { (sum / ring.len() as f32 - here).truncate() * k };
            let at = here.truncate() + by;
            *next = (at + plane.back(at, *heights)).extend(here.w);
        }
        std::mem::swap(&mut self.places, &mut self.next);
    }
}
