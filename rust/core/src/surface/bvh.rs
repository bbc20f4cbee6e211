//! The bounding volume hierarchy and the search for the nearest triangle.

use std::time::Duration;

use glam::{Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;

use super::closest_point::closest_on_triangle;

/// Binary hierarchy over triangles.
pub(super) struct Bvh(Bvh2);

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bvh of {} nodes", self.0.nodes.len())
    }
}

impl Bvh {
    /// Over a non-empty list of triangles.
    pub(super) fn new(corners: &[[Vec3; 3]]) -> Self {
        let boxes: Vec<Aabb> = corners.iter().enumerate().map(|(t, p)| jittered_box(t, p)).collect();
        Self(build_bvh2(&boxes, BvhBuildParams::fast_build(), &mut Duration::default()))
    }

    /// Position in `corners` of the triangle nearest to `query`, of equally near ones the first.
    pub(super) fn nearest(&self, query: Vec3, corners: &[[Vec3; 3]]) -> u32 {
        let mut best = (f64::INFINITY, 0);
        let mut stack = vec![(0.0, 0)];
        while let Some((bound, node)) = stack.pop() {
            if bound > best.0 {
                continue;
            }
            let node = &self.0.nodes[node as usize];
            let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            for &t in self.0.primitive_indices.get(range).into_iter().flatten() {
                let (_, squared) = closest_on_triangle(query.as_dvec3(), corners[t as usize].map(|p| p.as_dvec3()));
                if (squared, t) < best {
                    best = (squared, t);
                }
            }
            if !node.is_leaf() {
                let mut children = [node.first_index, node.first_index + 1].map(|n| (self.bound(n, query), n));
                children.sort_by(|x, y| y.0.total_cmp(&x.0));
                stack.extend(children);
            }
        }
        best.1
    }

    /// No more than the squared distance from `query` to the box of `node`.
    fn bound(&self, node: u32, query: Vec3) -> f64 {
        let aabb = self.0.nodes[node as usize].aabb();
        let query = Vec3A::from(query);
        let outside = (aabb.min - query).max(query - aabb.max).max(Vec3A::ZERO);
        f64::from(outside.length_squared()) * (1.0 - 1e-6)
    }
}

/// Box of triangle `t`, enlarged by an arbitrary little bit: the builder pairs the boxes whose union is smallest, and
/// equal costs, as among a million identical triangles, would let it find one pair a pass.
fn jittered_box(t: usize, corners: &[Vec3; 3]) -> Aabb {
    let [a, b, c] = corners.map(Vec3A::from);
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let noise = (t as u32).wrapping_mul(0x9e37_79b9) as f32 / u32::MAX as f32;
    let margin = (max - min).max_element() * 1e-4 * noise;
    Aabb { min: min - margin, max: max + margin }
}
