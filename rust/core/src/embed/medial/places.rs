//! Places that joints may take: middles of spheres inside the mesh, and its extremities.

use glam::DVec3;
use rayon::prelude::*;

use super::symmetry::{Side, Symmetry};
use crate::error::Result;
use crate::inside::{Lattice, Paths, UNREACHED};
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::surface::SurfaceIndex;

/// A place is no nearer to a larger sphere's middle than this share of its radius, nor than so many cells.
const APART: f64 = 0.6;
const CELLS_APART: f64 = 2.5;

/// An extremity is the farthest point from the middle of the body within this share of the mesh's diameter.
const ALONE: f64 = 0.06;

/// Most places; of more, the largest spheres.
const MOST: usize = 500;

/// Places, and how far it is from each to each.
#[derive(Debug)]
pub(super) struct Places {
    pub(super) nodes: Vec<u32>,
    pub(super) points: Vec<DVec3>,
    pub(super) is_extremity: Vec<bool>,
    pub(super) side: Vec<Side>,
    /// Distance of each node of the lattice from the surface.
    pub(super) clearance: Vec<f64>,
    /// World length of the way from each place to each, (n, n).
    ways: Vec<f64>,
}

impl Places {
    pub(super) fn new(
        mesh: &TriMesh<'_>,
        lattice: &Lattice,
        symmetry: Option<&Symmetry>,
        progress: &Progress,
    ) -> Result<Self> {
        let middles: Vec<[f32; 3]> =
            (0..lattice.len() as u32).map(|node| lattice.middle(node).as_vec3().to_array()).collect();
        let points = SurfaceIndex::new(mesh).closest_points(&middles);
        progress.check()?;
        let clearance: Vec<f64> = points.iter().map(|p| p.distance.max(0.25 * lattice.cells().size())).collect();
        let ends = extremities(lattice, &clearance);
        let mut nodes = ends.clone();
        pack(lattice, &clearance, symmetry, &mut nodes);
        let points: Vec<DVec3> = nodes.iter().map(|&node| lattice.middle(node)).collect();
        let side = |(k, &p): (usize, &DVec3)| symmetry.map_or(Side::Positive, |s| s.side_of(p, k < ends.len()));
        let way = |paths: &mut Paths<'_>, &node: &u32| {
            progress.check()?;
            paths.search([(node, 0)], |_| UNREACHED - 1);
            Ok(nodes.iter().map(|&other| paths.length(paths.distance(other))).collect::<Vec<f64>>())
        };
        let ways: Vec<Vec<f64>> = nodes.par_iter().map_init(|| Paths::new(lattice), way).collect::<Result<_>>()?;
        Ok(Self {
            is_extremity: (0..nodes.len()).map(|k| k < ends.len()).collect(),
            side: points.iter().enumerate().map(side).collect(),
            nodes,
            points,
            clearance,
            ways: ways.into_iter().flatten().collect(),
        })
    }

    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// World length of the way from one place to another.
    pub(super) fn way(&self, from: usize, to: usize) -> f64 {
        self.ways[from * self.len() + to]
    }

    /// Longest way between two extremities.
    pub(super) fn diameter(&self) -> f64 {
        let ends: Vec<usize> = (0..self.len()).filter(|&k| self.is_extremity[k]).collect();
        let longest = ends.iter().flat_map(|&a| ends.iter().map(move |&b| self.way(a, b))).fold(0.0, f64::max);
        if longest > 0.0 { longest } else { self.ways.iter().copied().fold(0.0, f64::max) }
    }
}

/// Nodes farther from the widest place than all around them.
fn extremities(lattice: &Lattice, clearance: &[f64]) -> Vec<u32> {
    let widest = (0..clearance.len()).max_by(|&a, &b| clearance[a].total_cmp(&clearance[b]).then(b.cmp(&a)));
    let mut paths = Paths::new(lattice);
    paths.search([(widest.expect("a lattice has a node") as u32, 0)], |_| UNREACHED - 1);
    let mut order: Vec<u32> = (0..clearance.len() as u32).collect();
    order.sort_by_key(|&node| (std::cmp::Reverse(paths.distance(node)), node));
    let farthest = paths.length(paths.distance(order[0]));
    let radius = ALONE * 2.0 * farthest;
    let is_top = |node: u32| lattice.neighbours(node).all(|(other, _)| paths.distance(other) <= paths.distance(node));
    let mut ends: Vec<u32> = Vec::new();
    for node in order {
        let point = lattice.middle(node);
        let is_far = paths.length(paths.distance(node)) > 0.2 * farthest;
        if is_far && is_top(node) && ends.iter().all(|&end| lattice.middle(end).distance(point) > radius) {
            ends.push(node);
        }
    }
    ends.truncate(40);
    ends
}

/// Adds the middles of spheres, the largest first.
fn pack(lattice: &Lattice, clearance: &[f64], symmetry: Option<&Symmetry>, nodes: &mut Vec<u32>) {
    let mut order: Vec<u32> = (0..clearance.len() as u32).collect();
    order.sort_by(|&a, &b| clearance[b as usize].total_cmp(&clearance[a as usize]).then(a.cmp(&b)));
    let (ends, least) = (nodes.len(), CELLS_APART * lattice.cells().size());
    let mut spheres: Vec<(DVec3, f64, Side)> = Vec::new();
    for node in order {
        let point = lattice.middle(node);
        let side = symmetry.map_or(Side::Positive, |symmetry| symmetry.side_of(point, false));
        // The other side is the image of this one.
        if side == Side::Negative {
            continue;
        }
        let is_free = |&(middle, reach, of): &(DVec3, f64, Side)| of != side || middle.distance(point) > reach;
        if spheres.iter().all(is_free) {
            spheres.push((point, (APART * clearance[node as usize]).max(least), side));
            nodes.push(node);
        }
        if nodes.len() - ends >= MOST {
            break;
        }
    }
}
