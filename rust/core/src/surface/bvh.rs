//! The bounding volume hierarchy and its construction.
//!
//! Eight triangles make a leaf, eight leaves a patch, both by median splits. obvhs builds a binary tree over the patches,
//! which is then collapsed to eight children a node. The boxes of a patch's leaves lie in a frame that follows
//! the patch: a piece of surface is flat, and in its own frame so is its box, which halves the leaves a query visits.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;

use super::flat::FlatTriangle;
use super::node::{Corners, Node, WIDTH, bounds};

/// The hierarchy.
#[derive(Debug)]
pub(super) struct Bvh {
    /// The patches, then the nodes above them.
    pub(super) nodes: Vec<Node>,
    /// The triangles, eight a leaf, thrice: for f32, for f64, and their indices in the mesh.
    pub(super) flat: Vec<FlatTriangle>,
    pub(super) corners: Vec<Corners>,
    pub(super) triangles: Vec<u32>,
    pub(super) root: u32,
}

/// A triangle on its way into a leaf.
struct Item {
    centre: Vec3,
    triangle: u32,
}

impl Bvh {
    /// Over the given triangles (indices, not empty), whose world corners `corners_of` tells.
    pub(super) fn new(triangles: &[u32], corners_of: impl Fn(u32) -> [Vec3; 3] + Sync) -> Self {
        let centre = |[a, b, c]: [Vec3; 3]| a.min(b).min(c) * 0.5 + a.max(b).max(c) * 0.5;
        let item = |&triangle: &u32| Item { centre: centre(corners_of(triangle)), triangle };
        let mut items: Vec<Item> = triangles.par_iter().map(item).collect();
        sort_into_leaves(&mut items);
        let corners: Vec<Corners> = items.par_iter().map(|i| corners_of(i.triangle).map(|p| p.to_array())).collect();
        let flat = items.par_iter().map(|i| FlatTriangle::new(corners_of(i.triangle))).collect();
        let patches = || corners.par_chunks(WIDTH * WIDTH).enumerate();
        let mut nodes: Vec<Node> = patches().map(|(p, patch)| Node::of_leaves(patch, p * WIDTH)).collect();
        let boxes: Vec<Aabb> = patches().map(|(p, patch)| box_of(p, patch)).collect();
        let root = add_inner_nodes(&mut nodes, &boxes);
        let triangles = items.iter().map(|i| i.triangle).collect();
        Self { nodes, flat, corners, triangles, root }
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

/// World box of patch `p`, enlarged by an arbitrary little bit: the builder merges boxes whose union is smallest for
/// both, and equal costs, as among a million identical triangles, would let it find only one pair a pass.
fn box_of(p: usize, patch: &[Corners]) -> Aabb {
    let (low, high) = bounds(patch.iter().flatten().map(|&p| Vec3::from(p).as_dvec3()));
    // Farther out the builder's extents would overflow.
    let [low, high] = [low, high].map(|p| Vec3A::from(p.as_vec3()).clamp(Vec3A::splat(-1e37), Vec3A::splat(1e37)));
    let noise = (p as u32).wrapping_mul(0x9e37_79b9) as f32 / u32::MAX as f32;
    let margin = noise * ((high - low).max_element() * 1e-4).max(1e-15);
    Aabb { min: low - margin, max: high + margin }
}

/// Adds the nodes above the patches, which are the first `boxes.len()` nodes, and returns the root.
fn add_inner_nodes(nodes: &mut Vec<Node>, boxes: &[Aabb]) -> u32 {
    let all = (0..boxes.len() as u32).collect();
    let builder = &mut PlocBuilder::with_capacity(boxes.len());
    let binary = builder.build(PlocSearchDistance::Low, boxes, all, SortPrecision::U64, 2);
    let patch_of = |n: usize| binary.primitive_indices[binary.nodes[n].first_index as usize];
    if binary.nodes[0].is_leaf() {
        return patch_of(0);
    }
    let root = nodes.len();
    nodes.push(Node::new(&[]));
    let mut todo = vec![(0, root)];
    while let Some((n, place)) = todo.pop() {
        let mut child = |n: usize| {
            let bounds = *binary.nodes[n].aabb();
            if binary.nodes[n].is_leaf() {
                return (patch_of(n), bounds);
            }
            todo.push((n, nodes.len()));
            nodes.push(Node::new(&[]));
            (nodes.len() as u32 - 1, bounds)
        };
        let children: Vec<_> = up_to_eight_below(&binary, n).into_iter().map(&mut child).collect();
        nodes[place] = Node::new(&children);
    }
    root as u32
}

/// Nodes that together stand for inner node `n`, found by always opening the largest.
fn up_to_eight_below(binary: &Bvh2, n: usize) -> Vec<usize> {
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
