//! What the hierarchy is made of: boxes and triangles, eight by eight, as SIMD wants them.

use glam::{DVec3, Vec3};
use obvhs::aabb::Aabb;

use super::closest_point::{rough_squared_distance, rounding};

/// Children of a node and triangles of a leaf.
pub(super) const WIDTH: usize = 8;
/// Marks a child that is a leaf.
pub(super) const LEAF: u32 = 1 << 31;
/// Of a patch's size; rotating a query into its frame in f32 errs by less than a tenth of this.
const BOX_MARGIN: f64 = 4e-6;

/// Eight triangles, lane by lane; a short leaf repeats its last one.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Leaf {
    /// World coordinates by corner, axis and lane.
    corners: [[[f32; WIDTH]; 3]; 3],
    /// The mesh's triangle indices.
    pub(super) triangles: [u32; WIDTH],
    /// Largest error of a rough distance, relative to the farthest corner's.
    rounding: f32,
    /// Longest edge.
    edge: f32,
}

/// Up to eight boxes in a common frame, lane by lane.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    /// Node indices, or leaf indices marked with [`LEAF`].
    pub(super) children: [u32; WIDTH],
    /// The lanes that hold a child, as bits.
    pub(super) used: u32,
    origin: [f32; 3],
    /// The frame's axes in world space.
    axes: [[f32; 3]; 3],
}

impl Leaf {
    /// Of up to eight triangles: corners and index.
    pub(super) fn new(triangles: &[([Vec3; 3], u32)]) -> Self {
        let mut leaf = Self { corners: Default::default(), triangles: [0; WIDTH], rounding: 0.0, edge: 0.0 };
        for lane in 0..WIDTH {
            let (corners, triangle) = triangles[lane.min(triangles.len() - 1)];
            leaf.triangles[lane] = triangle;
            for (stored, corner) in leaf.corners.iter_mut().zip(corners) {
                (0..3).for_each(|axis| stored[axis][lane] = corner[axis]);
            }
            leaf.rounding = leaf.rounding.max(rounding(corners.map(Vec3::as_dvec3)));
            let [a, b, c] = corners;
            leaf.edge = leaf.edge.max(a.distance(b)).max(a.distance(c)).max(b.distance(c));
        }
        leaf
    }

    /// Squared distances of the triangles from `query` in f32, good for [`Leaf::possible`] only.
    #[inline(always)]
    pub(super) fn rough_squared_distances(&self, query: Vec3) -> [f32; WIDTH] {
        let mut squared = [0.0; WIDTH];
        for (lane, squared) in squared.iter_mut().enumerate() {
            let corner = |[x, y, z]: &[[f32; WIDTH]; 3]| Vec3::new(x[lane], y[lane], z[lane]) - query;
            *squared = rough_squared_distance([0, 1, 2].map(|k| corner(&self.corners[k])));
        }
        squared
    }

    /// Which triangles may be no farther than `distance`, given their rough squared distances.
    #[inline(always)]
    pub(super) fn possible(&self, rough: &[f32; WIDTH], distance: f64) -> u32 {
        // The farthest corner is no farther than the distance and an edge.
        let limit = (distance as f32 + self.rounding * self.edge) * (1.0 + 4.0 * self.rounding);
        let limit = if self.rounding < 0.25 { limit * limit } else { f32::INFINITY };
        mask(rough.map(|squared| squared <= limit || !squared.is_finite()))
    }

    /// Corners of the triangle in `lane`, relative to `query`; in f64 the difference of two f32 loses next to nothing.
    #[inline(always)]
    pub(super) fn corners_from(&self, query: DVec3, lane: usize) -> [DVec3; 3] {
        [0, 1, 2].map(|k| {
            let [x, y, z] = &self.corners[k];
            DVec3::new(x[lane].into(), y[lane].into(), z[lane].into()) - query
        })
    }

    /// All corners.
    pub(super) fn points(&self) -> impl Iterator<Item = DVec3> {
        (0..WIDTH).flat_map(|lane| self.corners_from(DVec3::ZERO, lane))
    }

    /// Sum of the triangles' normals, each as long as twice the area.
    fn normal(&self) -> DVec3 {
        let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
        (0..WIDTH).map(|lane| normal(self.corners_from(DVec3::ZERO, lane))).sum()
    }
}

impl Node {
    /// Over `children` and their boxes, in the world's frame.
    pub(super) fn new(children: &[(u32, Aabb)]) -> Self {
        let mut node = Self {
            low: Default::default(),
            high: Default::default(),
            children: [0; WIDTH],
            used: 0,
            origin: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        };
        for &(child, bounds) in children {
            node.push(child, bounds.min.into(), bounds.max.into());
        }
        node
    }

    /// Over `leaves`, the first of which is leaf `first`, in a frame that follows their surface.
    pub(super) fn of_leaves(leaves: &[Leaf], first: usize) -> Self {
        let origin = leaves[0].corners_from(DVec3::ZERO, 0)[0];
        let mut node = Self::new(&[]);
        node.origin = origin.as_vec3().to_array();
        if let Some(normal) = leaves.iter().map(Leaf::normal).sum::<DVec3>().try_normalize() {
            let (x, y) = normal.any_orthonormal_pair();
            node.axes = [x, y, normal].map(|axis| axis.as_vec3().to_array());
        }
        let axes = node.axes.map(|axis| Vec3::from(axis).as_dvec3());
        let size = leaves.iter().flat_map(Leaf::points).map(|p| p.distance(origin)).fold(0.0, f64::max);
        for (child, leaf) in (LEAF | first as u32..).zip(leaves) {
            let (low, high) = bounds(leaf.points().map(|p| DVec3::from(axes.map(|axis| axis.dot(p - origin)))));
            node.push(child, (low - BOX_MARGIN * size).as_vec3(), (high + BOX_MARGIN * size).as_vec3());
        }
        node
    }

    fn push(&mut self, child: u32, low: Vec3, high: Vec3) {
        let lane = self.used.count_ones() as usize;
        self.used |= 1 << lane;
        self.children[lane] = child;
        for axis in 0..3 {
            self.low[axis][lane] = low[axis];
            self.high[axis][lane] = high[axis];
        }
    }

    /// Squared distances from `query` to the children's boxes, too large by a few 1e-6 of their value at most.
    #[inline(always)]
    pub(super) fn squared_distances(&self, query: [f32; 3]) -> [f32; WIDTH] {
        let from_origin = [0, 1, 2].map(|k| query[k] - self.origin[k]);
        let local = self.axes.map(|a| a[0] * from_origin[0] + a[1] * from_origin[1] + a[2] * from_origin[2]);
        let mut squared = [0.0; WIDTH];
        for (lane, squared) in squared.iter_mut().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|k| outside(self.low[k][lane] - local[k], local[k] - self.high[k][lane]));
            *squared = x * x + y * y + z * z;
        }
        squared
    }
}

/// Lanes as bits.
#[inline(always)]
pub(super) fn mask(lanes: [bool; WIDTH]) -> u32 {
    lanes.iter().enumerate().fold(0, |mask, (lane, &is_set)| mask | u32::from(is_set) << lane)
}

/// How far beyond an interval, from the signed distances to its ends.
#[inline(always)]
fn outside(below: f32, above: f32) -> f32 {
    let farther = if below > above { below } else { above };
    if farther > 0.0 { farther } else { 0.0 }
}

/// Lowest and highest coordinates.
pub(super) fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}
