//! Where the bones along a limb lie: on a way through the middle of the mesh, at their share of its length.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;

use super::discrete::Chosen;
use super::places::Places;
use super::reduced::Reduced;
use super::symmetry::{Side, Symmetry};
use crate::adjacency::NONE;
use crate::inside::Lattice;

/// How often a way is smoothed.
const SMOOTHING: usize = 4;

/// Where things lie in the mesh.
#[derive(Debug)]
pub(super) struct Points {
    /// Each joint of the reduced template.
    pub(super) joints: Vec<DVec3>,
    /// Heads of the bones along the limb that leads to each joint.
    pub(super) along: Vec<Vec<DVec3>>,
}

pub(super) fn place(
    lattice: &Lattice,
    places: &Places,
    reduced: &Reduced,
    chosen: &Chosen,
    symmetry: Option<&Symmetry>,
) -> Points {
    let side = |k: usize| symmetry.map_or(Side::Positive, |symmetry| symmetry.side[k]);
    let place = |k: usize| {
        let point = places.points[chosen.places[k]];
        match (side(k), symmetry) {
            (Side::Plane, Some(symmetry)) => symmetry.on_plane(point),
            (Side::Negative, Some(symmetry)) => symmetry.image(point),
            _ => point,
        }
    };
    let joints: Vec<DVec3> = (0..reduced.joints.len()).map(place).collect();
    let mut along = vec![Vec::new(); joints.len()];
    for (k, joint) in reduced.joints.iter().enumerate() {
        let Some(limb) = joint.limb.as_ref().filter(|_| side(k) != Side::Negative) else { continue };
        let nodes = way(lattice, places, chosen.places[limb.from], chosen.places[k]);
        let mut points: Vec<DVec3> = nodes.iter().map(|&node| lattice.middle(node)).collect();
        let last = points.len() - 1;
        (points[0], points[last]) = (joints[limb.from], joints[k]);
        smooth(&mut points);
        let found = limb.shares.iter().map(|&share| at(&points, share));
        let found = found.map(|(p, direction)| centred(lattice, &places.clearance, p, direction));
        let on_plane = |p| if side(k) == Side::Plane { symmetry.map_or(p, |symmetry| symmetry.on_plane(p)) } else { p };
        along[k] = found.map(on_plane).collect();
    }
    if let Some(symmetry) = symmetry {
        for k in (0..joints.len()).filter(|&k| side(k) == Side::Negative) {
            along[k] = along[symmetry.joint_image[k]].iter().map(|&p| symmetry.image(p)).collect();
        }
    }
    Points { joints, along }
}

/// Nodes on the way from one place to another that keeps to the middle: a step costs its length over its distance from the
/// surface.
fn way(lattice: &Lattice, places: &Places, from: usize, to: usize) -> Vec<u32> {
    let (from, to) = (places.nodes[from], places.nodes[to]);
    let mut cost = vec![u64::MAX; lattice.len()];
    let mut before = vec![NONE; lattice.len()];
    let mut queue = BinaryHeap::from([Reverse((0u64, from))]);
    cost[from as usize] = 0;
    while let Some(Reverse((so_far, node))) = queue.pop() {
        if node == to {
            break;
        }
        if so_far > cost[node as usize] {
            continue;
        }
        for (other, length) in lattice.neighbours(node) {
            let clearance = places.clearance[node as usize].min(places.clearance[other as usize]);
            let step = length * lattice.cells().size() / clearance * 1e4;
            let total = so_far + step as u64;
            if total < cost[other as usize] {
                (cost[other as usize], before[other as usize]) = (total, node);
                queue.push(Reverse((total, other)));
            }
        }
    }
    let mut nodes = vec![to];
    while nodes[nodes.len() - 1] != from && before[nodes[nodes.len() - 1] as usize] != NONE {
        nodes.push(before[nodes[nodes.len() - 1] as usize]);
    }
    nodes.reverse();
    nodes
}

fn smooth(points: &mut [DVec3]) {
    for _ in 0..SMOOTHING {
        let before = points.to_vec();
        for k in 1..points.len().saturating_sub(1) {
            points[k] = 0.25 * before[k - 1] + 0.5 * before[k] + 0.25 * before[k + 1];
        }
    }
}

/// The point at a share of the way's length, and the direction there.
fn at(points: &[DVec3], share: f64) -> (DVec3, DVec3) {
    let lengths: Vec<f64> = points.windows(2).map(|pair| pair[0].distance(pair[1])).collect();
    let mut left = share * lengths.iter().sum::<f64>();
    for (pair, length) in points.windows(2).zip(&lengths) {
        if left <= *length && *length > 0.0 {
            return (pair[0].lerp(pair[1], left / length), (pair[1] - pair[0]).normalize_or_zero());
        }
        left -= length;
    }
    (points[points.len() - 1], DVec3::ZERO)
}

/// The middle of the limb's cross-section at `p`: the mean of the nodes across `direction` that hang together there.
fn centred(lattice: &Lattice, clearance: &[f64], p: DVec3, direction: DVec3) -> DVec3 {
    let start = lattice.nearest_node(p);
    let reach = 2.0 * clearance[start as usize] + lattice.cells().size();
    let (mut found, mut seen) = (vec![start], std::collections::HashSet::from([start]));
    let (mut k, mut sum, mut count) = (0, DVec3::ZERO, 0.0);
    while k < found.len() {
        let middle = lattice.middle(found[k]);
        sum += middle;
        count += 1.0;
        for (other, _) in lattice.neighbours(found[k]) {
            let offset = lattice.middle(other) - p;
            let is_across = offset.dot(direction).abs() <= lattice.cells().size() && offset.length() < reach;
            if is_across && seen.insert(other) {
                found.push(other);
            }
        }
        k += 1;
    }
    let centre: DVec3 = sum / count;
    let moved = (centre - p) - (centre - p).dot(direction) * direction;
    if lattice.node_at(p + moved).is_some() { p + moved } else { p }
}
