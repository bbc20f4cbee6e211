//! The bounding volume hierarchy: its layout and its construction.
//!
//! Eight triangles make a leaf, eight leaves a patch, both by median splits. obvhs builds a binary tree over the patches,
//! which is then collapsed to eight children a node. The boxes of a patch's leaves lie in a frame that follows
//! the patch: a piece of surface is flat, and in its own frame so is its box, which halves the leaves a query visits.

use glam::{DMat3, DVec3, Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

/// Children of a node and triangles of a leaf.
pub(super) const WIDTH: usize = 8;
/// Marks a child that is a leaf.
pub(super) const LEAF: u32 = 1 << 31;

/// Eight triangles, lane by lane; a short leaf repeats its last one.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Leaf {
    /// World coordinates by corner, axis and lane.
    corners: [[[f32; WIDTH]; 3]; 3],
    /// The mesh's triangle indices.
    pub(super) triangles: [u32; WIDTH],
}

/// Up to eight boxes in a common frame, lane by lane; those missing are infinitely far.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Node {
    low: [[f32; WIDTH]; 3],
    high: [[f32; WIDTH]; 3],
    /// Node indices, or leaf indices marked with [`LEAF`].
    pub(super) children: [u32; WIDTH],
    origin: [f32; 3],
    /// The frame's axes in world space.
    axes: [[f32; 3]; 3],
}

/// The hierarchy.
#[derive(Debug)]
pub(super) struct Bvh {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
    pub(super) root: u32,
}

/// A triangle on its way into a leaf.
struct Item {
    centre: Vec3,
    triangle: u32,
}

impl Leaf {
    fn new(items: &[Item], corners_of: &impl Fn(u32) -> [Vec3; 3]) -> Self {
        let mut leaf = Self { corners: Default::default(), triangles: [0; WIDTH] };
        for lane in 0..WIDTH {
            let triangle = items[lane.min(items.len() - 1)].triangle;
            leaf.triangles[lane] = triangle;
            for (stored, corner) in leaf.corners.iter_mut().zip(corners_of(triangle)) {
                (0..3).for_each(|axis| stored[axis][lane] = corner[axis]);
            }
        }
        leaf
    }

    /// Corners of the triangle in `lane`, relative to `query`; the difference of two f32 is exact in f64.
    #[inline(always)]
    pub(super) fn corners_from(&self, query: DVec3, lane: usize) -> [DVec3; 3] {
        [0, 1, 2].map(|k| {
            let [x, y, z] = &self.corners[k];
            DVec3::new(x[lane].into(), y[lane].into(), z[lane].into()) - query
        })
    }

    fn points(&self) -> impl Iterator<Item = DVec3> {
        (0..WIDTH).flat_map(|lane| self.corners_from(DVec3::ZERO, lane))
    }
}

impl Node {
    /// A node in the world's frame.
    fn new(children: &[(u32, Aabb)]) -> Self {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut node = Self {
            low: [[f32::INFINITY; WIDTH]; 3],
            high: [[f32::NEG_INFINITY; WIDTH]; 3],
            children: [0; WIDTH],
            origin: [0.0; 3],
            axes,
        };
        for (lane, (child, bounds)) in children.iter().enumerate() {
            node.children[lane] = *child;
            node.set_box(lane, bounds.min.into(), bounds.max.into());
        }
        node
    }

    /// A node over `leaves`, the first of which is leaf `first`, in the frame that follows their surface.
    fn of_leaves(leaves: &[Leaf], first: usize) -> Self {
        let origin = leaves[0].corners_from(DVec3::ZERO, 0)[0];
        let frame = frame_of(leaves);
        let mut node = Self::new(&[]);
        node.origin = origin.as_vec3().to_array();
        node.axes = frame.as_mat3().transpose().to_cols_array_2d();
        let axes = DMat3::from_cols_array_2d(&node.axes.map(|axis| axis.map(f64::from))).transpose();
        let size = leaves.iter().flat_map(Leaf::points).map(|p| (p - origin).length()).fold(0.0, f64::max);
        for (lane, leaf) in leaves.iter().enumerate() {
            node.children[lane] = LEAF | (first + lane) as u32;
            let (low, high) = bounds(leaf.points().map(|p| axes * (p - origin)));
            // Rotating the query in f32 errs by up to 1e-6 of its distance from the origin.
            node.set_box(lane, (low - 4e-6 * size).as_vec3(), (high + 4e-6 * size).as_vec3());
        }
        node
    }

    fn set_box(&mut self, lane: usize, low: Vec3, high: Vec3) {
        for axis in 0..3 {
            self.low[axis][lane] = low[axis];
            self.high[axis][lane] = high[axis];
        }
    }

    /// Squared distances from `query` to the children's boxes, right to a few 1e-6 of their value, never much above.
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

/// How far beyond an interval, from the signed distances to its ends.
#[inline(always)]
fn outside(below: f32, above: f32) -> f32 {
    let farther = if below > above { below } else { above };
    if farther > 0.0 { farther } else { 0.0 }
}

impl Bvh {
    /// Over the given triangles (indices, not empty), whose world corners `corners_of` tells.
    pub(super) fn new(triangles: &[u32], corners_of: impl Fn(u32) -> [Vec3; 3] + Sync) -> Self {
        let centre = |[a, b, c]: [Vec3; 3]| a.min(b).min(c) * 0.5 + a.max(b).max(c) * 0.5;
        let item = |&triangle: &u32| Item { centre: centre(corners_of(triangle)), triangle };
        let mut items: Vec<Item> = triangles.par_iter().map(item).collect();
        sort_into_leaves(&mut items);
        let leaves: Vec<Leaf> = items.par_chunks(WIDTH).map(|items| Leaf::new(items, &corners_of)).collect();
        let patches = leaves.par_chunks(WIDTH).enumerate();
        let mut nodes: Vec<Node> = patches.map(|(p, leaves)| Node::of_leaves(leaves, p * WIDTH)).collect();
        let boxes: Vec<Aabb> = leaves.par_chunks(WIDTH).map(world_box).collect();
        let root = add_inner_nodes(&mut nodes, &boxes);
        Self { nodes, leaves, root }
    }
}

/// Orders `items` so that each aligned run of 8, 64, 512, ... is compact: halves at a power of two, along the widest axis.
fn sort_into_leaves(items: &mut [Item]) {
    if items.len() <= WIDTH {
        return;
    }
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = items.iter().fold(empty, |(low, high), i| (low.min(i.centre), high.max(i.centre)));
    let axis = (high - low).max_position();
    let half = items.len().next_power_of_two() / 2;
    items.select_nth_unstable_by(half, |x, y| x.centre[axis].total_cmp(&y.centre[axis]));
    let (left, right) = items.split_at_mut(half);
    if half < 4096 {
        sort_into_leaves(left);
        sort_into_leaves(right);
    } else {
        rayon::join(|| sort_into_leaves(left), || sort_into_leaves(right));
    }
}

/// Adds the nodes above the patches, which are the first `boxes.len()` nodes, and returns the root.
fn add_inner_nodes(nodes: &mut Vec<Node>, boxes: &[Aabb]) -> u32 {
    let jittered: Vec<Aabb> = boxes.iter().enumerate().map(|(p, b)| jittered(p, b)).collect();
    let all = (0..boxes.len() as u32).collect();
    let builder = &mut PlocBuilder::with_capacity(boxes.len());
    let binary = builder.build(PlocSearchDistance::Low, &jittered, all, SortPrecision::U64, 2);
    let patch_of = |n: usize| binary.primitive_indices[binary.nodes[n].first_index as usize];
    if binary.nodes[0].is_leaf() {
        return patch_of(0);
    }
    let root = nodes.len();
    nodes.push(Node::new(&[]));
    let mut todo = vec![(0, root)];
    while let Some((n, slot)) = todo.pop() {
        let children: Vec<(u32, Aabb)> = eight_below(&binary, n)
            .into_iter()
            .map(|child| {
                let bounds = *binary.nodes[child].aabb();
                if binary.nodes[child].is_leaf() {
                    return (patch_of(child), bounds);
                }
                todo.push((child, nodes.len()));
                nodes.push(Node::new(&[]));
                (nodes.len() as u32 - 1, bounds)
            })
            .collect();
        nodes[slot] = Node::new(&children);
    }
    root as u32
}

/// The up to eight nodes below inner node `n` found by always opening the largest.
fn eight_below(binary: &Bvh2, n: usize) -> Vec<usize> {
    let first = binary.nodes[n].first_index as usize;
    let mut below = vec![first, first + 1];
    while below.len() < WIDTH {
        let area = |&place: &usize| binary.nodes[below[place]].aabb().half_area();
        let inner = (0..below.len()).filter(|&place| !binary.nodes[below[place]].is_leaf());
        let Some(largest) = inner.max_by(|x, y| area(x).total_cmp(&area(y))) else { break };
        let first = binary.nodes[below[largest]].first_index as usize;
        below[largest] = first;
        below.push(first + 1);
    }
    below
}

/// Box of patch `p`, enlarged by an arbitrary little bit: the builder merges boxes whose union is smallest for both,
/// and equal costs, as among a million identical triangles, would let it find only one pair a pass.
fn jittered(p: usize, bounds: &Aabb) -> Aabb {
    let noise = (p as u32).wrapping_mul(0x9e37_79b9) as f32 / u32::MAX as f32;
    let margin = noise * ((bounds.max - bounds.min).max_element() * 1e-4).max(1e-15);
    Aabb { min: bounds.min - margin, max: bounds.max + margin }
}

/// Rows of a rotation whose last axis is the mean normal; the world's where there is none.
fn frame_of(leaves: &[Leaf]) -> DMat3 {
    let mut normal = DVec3::ZERO;
    for leaf in leaves {
        for lane in 0..WIDTH {
            let [a, b, c] = leaf.corners_from(DVec3::ZERO, lane);
            normal += (b - a).cross(c - a);
        }
    }
    let Some(normal) = normal.try_normalize() else { return DMat3::IDENTITY };
    let (x, y) = normal.any_orthonormal_pair();
    DMat3::from_cols(x, y, normal).transpose()
}

fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

fn world_box(leaves: &[Leaf]) -> Aabb {
    let (low, high) = bounds(leaves.iter().flat_map(Leaf::points));
    Aabb { min: Vec3A::from(low.as_vec3()), max: Vec3A::from(high.as_vec3()) }
}
