//! The choice among the triangles that may be nearest, in f64.

// Loops over indices become SIMD code here, iterators did not.
#![allow(clippy::needless_range_loop)]

use glam::{DVec3, Vec3};

use super::SurfacePoint;
use super::bvh::Bvh;
use super::closest_point::closest_to_origin;
use super::lanes::LANES;

/// Queries looked at together: a register of f64.
const GROUP: usize = 4;

/// Squared distances that differ by less than this share are equal.
const TIE: f64 = 1e-9;

/// Makes of a triangle's squared distance the one up to which others are as near.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    factor: f64,
    offset: f64,
}

impl Reach {
    /// Of what is no more than `tolerance` farther away, and a little more: `(d + t)^2 <= (1 + s) d^2 + (1 + 1 / s) t^2`.
    pub(super) fn new(tolerance: f64) -> Self {
        let share = if tolerance > 0.0 { 1e-4 } else { TIE };
        Self { factor: 1.0 + share, offset: (1.0 + 1.0 / share) * tolerance * tolerance }
    }

    #[inline(always)]
    pub(super) fn of(&self, squared: f64) -> f64 {
        squared * self.factor + self.offset
    }

    /// Numbers that make of an upper bound in f32 one within which are all that are as near, whatever is rounded.
    pub(super) fn in_f32(&self) -> (f32, f32) {
        if self.offset == 0.0 { (1.0, 0.0) } else { (self.factor as f32 + 1e-6, (1.01 * self.offset) as f32) }
    }
}

/// The nearest triangle of each query so far.
pub(super) struct Nearest {
    reach: Reach,
    squared: [f64; LANES],
    /// How many others are equally near, by their distances when they were looked at.
    ties: [u64; LANES],
    barycentric: [[f64; LANES]; 3],
    triangle: [u64; LANES],
    place: [u64; LANES],
}

impl Nearest {
    /// Infinitely far.
    #[inline(always)]
    pub(super) fn new(bvh: &Bvh, reach: Reach) -> Self {
        Self {
            reach,
            squared: [f64::INFINITY; LANES],
            ties: [0; LANES],
            barycentric: [[1.0; LANES], [0.0; LANES], [0.0; LANES]],
            triangle: [bvh.triangles[0].into(); LANES],
            place: [0; LANES],
        }
    }

    /// Takes the triangle at `place` into account, of equally near ones the lowest index, for `queries` (world
    /// coordinates by axis) of which at least those in the bits of `asking` want it.
    #[inline(always)]
    pub(super) fn consider(&mut self, bvh: &Bvh, place: u32, queries: &[[f64; LANES]; 3], asking: u32) {
        let corners = bvh.corners[place as usize].map(|p| Vec3::from(p).as_dvec3());
        let triangle = u64::from(bvh.triangles[place as usize]);
        for first in (0..LANES).step_by(GROUP) {
            if asking >> first & ((1 << GROUP) - 1) == 0 {
                continue;
            }
            for lane in first..first + GROUP {
                let query = DVec3::new(queries[0][lane], queries[1][lane], queries[2][lane]);
                let (barycentric, squared) =
                    closest_to_origin([corners[0] - query, corners[1] - query, corners[2] - query]);
                let best = self.squared[lane];
                let nearer = (squared < best) | ((squared == best) & (triangle < self.triangle[lane]));
                let ties = self.ties[lane] + u64::from(squared <= self.reach.of(best));
                self.ties[lane] = if self.reach.of(squared) < best { 0 } else { ties };
                self.squared[lane] = if nearer { squared } else { best };
                for k in 0..3 {
                    self.barycentric[k][lane] = if nearer { barycentric[k] } else { self.barycentric[k][lane] };
                }
                self.triangle[lane] = if nearer { triangle } else { self.triangle[lane] };
                self.place[lane] = if nearer { place.into() } else { self.place[lane] };
            }
        }
    }

    #[inline(always)]
    pub(super) fn surface_point(&self, lane: usize) -> SurfacePoint {
        SurfacePoint {
            triangle: self.triangle[lane] as u32,
            barycentric: [self.barycentric[0][lane], self.barycentric[1][lane], self.barycentric[2][lane]],
            distance: self.squared[lane].sqrt(),
        }
    }

    /// How many other triangles are as near; where some come within rounding errors of that, they may be counted too.
    #[inline(always)]
    pub(super) fn ties(&self, lane: usize) -> u32 {
        self.ties[lane] as u32
    }

    /// Place of the nearest triangle.
    #[inline(always)]
    pub(super) fn place(&self, lane: usize) -> u32 {
        self.place[lane] as u32
    }
}
