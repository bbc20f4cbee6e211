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

/// Triangles whose squared distances differ by less than this share are equally near.
const TIE: f64 = 1e-9;

/// The nearest triangle of each query so far.
pub(super) struct Nearest {
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
    pub(super) fn new(bvh: &Bvh) -> Self {
        Self {
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
                let ties = self.ties[lane] + u64::from(squared <= best * (1.0 + TIE));
                self.ties[lane] = if squared < best * (1.0 - TIE) { 0 } else { ties };
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
