//! The search for the triangle nearest to a query.
//!
//! The eight triangles of a leaf are looked at in f32, and in f64 only those that the bound on its error lets be nearest.

use glam::Vec3;
use pulp::{Simd, WithSimd};

use super::SurfacePoint;
use super::bvh::Bvh;
use super::closest_point::closest_to_origin;
use super::node::{LEAF, Leaf, mask};

/// Squared distances to boxes are f32; this much more than the best so far is still looked into.
const BOX_SLACK: f64 = 1e-5;

/// Searches for consecutive queries that lie close together, each starting at the leaf where the last one ended.
///
/// Dispatched once for many queries, so that all below is compiled for the widest SIMD the machine has.
pub(super) struct Batch<'a> {
    pub(super) bvh: &'a Bvh,
    pub(super) queries: &'a [[f32; 3]],
    pub(super) answers: &'a mut [SurfacePoint],
}

impl WithSimd for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let mut stack = Vec::new();
        let mut start = 0;
        for (&query, answer) in self.queries.iter().zip(self.answers) {
            let nearest = nearest(self.bvh, query, start, &mut stack);
            start = nearest.leaf;
            *answer = nearest.surface_point();
        }
    }
}

/// A triangle, its point nearest to the query, and how far that is.
#[derive(Clone, Copy)]
struct Nearest {
    squared: f64,
    barycentric: [f64; 3],
    triangle: u32,
    leaf: u32,
}

impl Nearest {
    #[inline(always)]
    fn surface_point(self) -> SurfacePoint {
        SurfacePoint { triangle: self.triangle, barycentric: self.barycentric, distance: self.squared.sqrt() }
    }

    /// Takes the triangles of `leaf`, the hierarchy's number `place`, into account, of equally near ones the lowest index.
    #[inline(always)]
    fn visit(&mut self, leaf: &Leaf, place: u32, query: Vec3) {
        let rough = leaf.rough_squared_distances(query);
        let mut left = leaf.possible(&rough, self.squared.sqrt());
        while left != 0 {
            let mut lane = left.trailing_zeros() as usize;
            for other in lanes(left) {
                lane = if rough[other] < rough[lane] { other } else { lane };
            }
            let (barycentric, squared) = closest_to_origin(leaf.corners_from(query.as_dvec3(), lane));
            let triangle = leaf.triangles[lane];
            if squared < self.squared || (squared == self.squared && triangle < self.triangle) {
                *self = Self { squared, barycentric, triangle, leaf: place };
            }
            left &= leaf.possible(&rough, self.squared.sqrt()) & !(1 << lane);
        }
    }

    /// Boxes farther than this, squared, hold nothing as near.
    #[inline(always)]
    fn limit(&self) -> f32 {
        (self.squared * (1.0 + BOX_SLACK)) as f32 + f32::MIN_POSITIVE
    }
}

/// Descends into the nearest box first. `start` is a leaf that is likely near; it does not change the answer.
#[inline(always)]
fn nearest(bvh: &Bvh, query: [f32; 3], start: u32, stack: &mut Vec<(f32, u32)>) -> Nearest {
    let first = bvh.leaves[start as usize].triangles[0];
    let mut best = Nearest { squared: f64::INFINITY, barycentric: [1.0, 0.0, 0.0], triangle: first, leaf: start };
    best.visit(&bvh.leaves[start as usize], start, query.into());
    stack.clear();
    stack.push((0.0, bvh.root));
    while let Some((squared, child)) = stack.pop() {
        if squared > best.limit() {
            continue;
        }
        if child & LEAF != 0 {
            if child != LEAF | start {
                let leaf = child & !LEAF;
                best.visit(&bvh.leaves[leaf as usize], leaf, query.into());
            }
            continue;
        }
        let node = &bvh.nodes[child as usize];
        let squared = node.squared_distances(query);
        let limit = best.limit();
        let bottom = stack.len();
        for lane in lanes(node.used & mask(squared.map(|s| s <= limit))) {
            insert_descending(stack, bottom, (squared[lane], node.children[lane]));
        }
    }
    best
}

/// The lanes that are set, in order.
#[inline(always)]
fn lanes(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < u32::BITS as usize).then_some(lane)
    })
}

/// Inserts into `stack[bottom..]`, whose last is the nearest.
#[inline(always)]
fn insert_descending(stack: &mut Vec<(f32, u32)>, bottom: usize, entry: (f32, u32)) {
    stack.push(entry);
    let mut place = stack.len() - 1;
    while place > bottom && stack[place - 1].0 < entry.0 {
        stack[place] = stack[place - 1];
        place -= 1;
    }
    stack[place] = entry;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machines_simd_does_not_change_a_bit() {
        let wave = |i: u32| (i as f32 * 12.9898).sin();
        let point = |i: u32| Vec3::new(wave(3 * i), wave(3 * i + 1), wave(3 * i + 2));
        let triangles: Vec<u32> = (0..2000).collect();
        let bvh = Bvh::new(&triangles, |t| [point(t), point(t) + 0.1 * point(t + 7), point(t) + 0.2 * point(t + 9)]);
        let queries: Vec<_> = (0..500).map(|i| (1.5 * point(31 * i)).to_array()).collect();
        let mut answers = [vec![SurfacePoint::default(); 500], vec![SurfacePoint::default(); 500]];
        let [widest, scalar] = &mut answers;
        pulp::Arch::new().dispatch(Batch { bvh: &bvh, queries: &queries, answers: widest });
        Batch { bvh: &bvh, queries: &queries, answers: scalar }.with_simd(pulp::Scalar::new());
        assert_eq!(answers[0], answers[1]);
    }
}
