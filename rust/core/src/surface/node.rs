//! What the hierarchy is made of: eight boxes a node.

use glam::{DVec3, Vec3};
use obvhs::aabb::Aabb;
use pulp::Simd;

use super::lanes::{Lanes, Register, into_frame};

/// Children of a node and triangles of a leaf.
pub(super) const WIDTH: usize = 8;
/// Marks a child that is a leaf.
pub(super) const LEAF: u32 = 1 << 31;
/// Of a patch's size; rotating a query into its frame in f32 errs by less than a tenth of this.
const BOX_MARGIN: f64 = 4e-6;
/// Squared distances to boxes in f32 err by less than this share of their value.
const SHARE: f32 = 1e-5;

/// Up to eight boxes in a common frame.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    /// Node indices, or leaf indices marked with [`LEAF`].
    pub(super) children: [u32; WIDTH],
    /// How many there are.
    pub(super) count: usize,
    origin: [f32; 3],
    /// The frame's axes in world space.
    axes: [[f32; 3]; 3],
}

/// World coordinates of a triangle's corners.
pub(super) type Corners = [[f32; 3]; 3];

fn wide(corners: &Corners) -> [DVec3; 3] {
    corners.map(|p| Vec3::from(p).as_dvec3())
}

/// Twice the area along the normal.
fn normal(corners: &Corners) -> DVec3 {
    let [a, b, c] = wide(corners);
    (b - a).cross(c - a)
}

impl Node {
    /// Over `children` and their boxes, in the world's frame.
    pub(super) fn new(children: &[(u32, Aabb)]) -> Self {
        let mut node = Self {
            low: Default::default(),
            high: Default::default(),
            children: [0; WIDTH],
            count: 0,
            origin: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        };
        for &(child, bounds) in children {
            node.push(child, bounds.min.into(), bounds.max.into());
        }
        node
    }

    /// Over the leaves of `triangles`, the first of which is leaf `first`, in a frame that follows their surface.
    pub(super) fn of_leaves(triangles: &[Corners], first: usize) -> Self {
        let origin = wide(&triangles[0])[0];
        let mut node = Self::new(&[]);
        node.origin = origin.as_vec3().to_array();
        if let Some(normal) = triangles.iter().map(normal).sum::<DVec3>().try_normalize() {
            let (x, y) = normal.any_orthonormal_pair();
            node.axes = [x, y, normal].map(|axis| axis.as_vec3().to_array());
        }
        let axes = node.axes.map(|axis| Vec3::from(axis).as_dvec3());
        let size = triangles.iter().flat_map(wide).map(|p| p.distance(origin)).fold(0.0, f64::max);
        for (child, leaf) in (LEAF | first as u32..).zip(triangles.chunks(WIDTH)) {
            let (low, high) =
                bounds(leaf.iter().flat_map(wide).map(|p| DVec3::from(axes.map(|axis| axis.dot(p - origin)))));
            node.push(child, (low - BOX_MARGIN * size).as_vec3(), (high + BOX_MARGIN * size).as_vec3());
        }
        node
    }

    fn push(&mut self, child: u32, low: Vec3, high: Vec3) {
        self.children[self.count] = child;
        for axis in 0..3 {
            self.low[axis][self.count] = low[axis];
            self.high[axis][self.count] = high[axis];
        }
        self.count += 1;
    }

    /// `queries` (by axis) in the boxes' frame.
    #[inline(always)]
    pub(super) fn local<S: Simd>(&self, simd: S, [x, y, z]: &[Lanes; 3]) -> [Lanes; 3] {
        let mut local = [Lanes::ZERO; 3];
        for k in 0..Register::<S>::COUNT {
            let query = [Register::load(simd, x, k), Register::load(simd, y, k), Register::load(simd, z, k)];
            let [x, y, z] = into_frame(simd, query, &self.origin, &self.axes);
            x.store(&mut local[0], k);
            y.store(&mut local[1], k);
            z.store(&mut local[2], k);
        }
        local
    }

    /// Squared distances from queries in the boxes' frame to one box, or a little less.
    #[inline(always)]
    pub(super) fn squared_distances<S: Simd>(&self, simd: S, child: usize, local: &[Lanes; 3]) -> Lanes {
        let mut squared = Lanes::ZERO;
        for k in 0..Register::<S>::COUNT {
            let mut sum = Register::splat(simd, 0.0);
            for (axis, local) in local.iter().enumerate() {
                let at = Register::load(simd, local, k);
                let low = Register::splat(simd, self.low[axis][child]);
                let high = Register::splat(simd, self.high[axis][child]);
                let outside = (low - at).max(at - high).max(Register::splat(simd, 0.0));
                sum = sum + outside * outside;
            }
            (sum * Register::splat(simd, 1.0 - SHARE)).store(&mut squared, k);
        }
        squared
    }
}

/// Lowest and highest coordinates.
pub(super) fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}
