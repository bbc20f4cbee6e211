//! Skin in a crease, copied close together: dozens of passes go over a few thousand vertices.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::constraint::{HalfSpace, self_collision};
use super::joints::Member;
use super::local::Local;

/// The side of what the plane does not concern.
const NONE: f32 = f32::NAN;

/// Vertices that one task moves.
const RUN: usize = 1024;

/// Vertices that move, then those around them, with the neighbours and the sides of the first.
pub(super) struct Membrane {
    /// Of the vertices that move.
    sides: Vec<f32>,
    starts: Vec<u32>,
    rings: Vec<u32>,
    /// The particles of all.
    all: Vec<u32>,
    places: Vec<Vec4>,
    /// The places after the pass under way.
    next: Vec<Vec4>,
    /// How far a pass moves towards the mean of the neighbours, and how many stand for one.
    smoothing: f32,
    repeats: usize,
}

impl Membrane {
    /// Of the vertices `moving`; `members` are those that have a side (both ascending).
    pub(super) fn new(local: &Local, moving: &[u32], members: &[Member], smoothing: f32, repeats: usize) -> Self {
        let moving = by_valence(local, moving, members);
        let mut number = vec![u32::MAX; local.particles.len() - local.nodes];
        moving.iter().enumerate().for_each(|(k, (p, _))| number[*p as usize - local.nodes] = k as u32);
        let mut all: Vec<u32> = moving.iter().map(|(p, _)| *p).collect();
        let (mut starts, mut rings) = (vec![0], Vec::with_capacity(moving.len() * 7));
        for (p, _) in &moving {
            for &n in local.ring(*p) {
                let number = &mut number[n as usize - local.nodes];
                if *number == u32::MAX {
                    *number = all.len() as u32;
                    all.push(n);
                }
                rings.push(*number);
            }
            starts.push(rings.len() as u32);
        }
        let sides = moving.into_iter().map(|(_, side)| side).collect();
        Self { sides, starts, rings, all, places: Vec::new(), next: Vec::new(), smoothing, repeats }
    }

    /// The vertices that move.
    pub(super) fn vertices(&self) -> &[u32] {
        &self.all[..self.sides.len()]
    }

    /// Passes: towards the neighbours' mean, then back to the own side of the plane.
    pub(super) fn relax(&mut self, local: &mut Local, plane: &HalfSpace, passes: usize) {
        self.places.clear();
        self.places.extend(self.all.iter().map(|&p| Vec4::from(local.particles[p as usize])));
        self.next.clone_from(&self.places);
        (0..passes * self.repeats).for_each(|_| self.pass(plane));
        for (&p, place) in self.vertices().iter().zip(&self.places) {
            let particle = &mut local.particles[p as usize];
            [particle[0], particle[1], particle[2]] = place.truncate().to_array();
        }
    }

    /// `p_i = (1 - k) p_i + k (mean of the neighbours)`, all at once (Eq. 16).
    fn pass(&mut self, plane: &HalfSpace) {
        let [child, parent, middle] = [1.0, -1.0, 0.0].map(|side| plane.heights(side));
        let Self { sides, starts, rings, places, next, smoothing, .. } = self;
        let of_one = |(k, (next, &side)): (usize, (&mut Vec4, &f32))| {
            let (here, ring) = (places[k], &rings[starts[k] as usize..starts[k + 1] as usize]);
            let sum: Vec4 = ring.iter().map(|&n| places[n as usize]).sum();
            let mean = sum / ring.len().max(1) as f32;
            let by = if ring.is_empty() { Vec3::ZERO } else { (mean - here).truncate() * *smoothing };
            let heights = if side > 0.0 {
                child
            } else if side < 0.0 {
                parent
            } else {
                middle
            };
            let at = here.truncate() + by;
            let back = if side.is_nan() { Vec3::ZERO } else { self_collision(plane, at, heights) };
            *next = (at + back).extend(here.w);
        };
        next.par_iter_mut().zip(&*sides).enumerate().with_min_len(RUN).for_each(of_one);
        std::mem::swap(&mut self.places, &mut self.next);
    }
}

/// Vertices with their sides, all that have equally many neighbours one after the other: loops of one length are
/// predicted.
fn by_valence(local: &Local, vertices: &[u32], members: &[Member]) -> Vec<(u32, f32)> {
    let mut rest = members.iter().peekable();
    let with_side = |&p: &u32| {
        while rest.next_if(|member| member.particle < p).is_some() {}
        (p, rest.next_if(|member| member.particle == p).map_or(NONE, |member| member.side))
    };
    let sided: Vec<(u32, f32)> = vertices.iter().map(with_side).collect();
    let valence = |p: u32| local.ring(p).len();
    let most = vertices.iter().map(|&p| valence(p)).max().unwrap_or(0);
    let mut starts = vec![0; most + 2];
    vertices.iter().for_each(|&p| starts[valence(p) + 1] += 1);
    (0..=most).for_each(|valence| starts[valence + 1] += starts[valence]);
    let mut sorted = sided.clone();
    for one in sided {
        let start = &mut starts[valence(one.0)];
        sorted[*start] = one;
        *start += 1;
    }
    sorted
}
