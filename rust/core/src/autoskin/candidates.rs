//! The bones that may influence a vertex, and how far away they are through the inside of the mesh.

use glam::DVec3;
use rayon::prelude::*;

use super::report::Report;
use super::skeleton::Skeleton;
use crate::error::Result;
use crate::inside::{Lattice, Paths, UNREACHED};
use crate::mesh::TriMesh;
use crate::progress::Progress;

/// Bones are followed this share of the mesh's diagonal farther than the nearest bone of each place: enough for a bone in front
/// of the surface to win over one behind it.
const REACH: f64 = 0.1;

/// Cells by which a straight way may leave the inside at its ends.
const SLACK: f64 = 1.5;

/// A bone and its distances from a vertex, world units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) vertex: u32,
    pub(super) bone: u32,
    /// Through the inside of the mesh.
    pub(super) distance: f64,
    /// Divided by [`facing`].
    pub(super) effective: f64,
}

/// The candidates of every vertex, by bone; at least one each.
pub(super) struct Candidates {
    starts: Vec<usize>,
    all: Vec<Candidate>,
    pub(super) n_bones: u32,
}

impl Candidates {
    pub(super) fn new(
        mesh: &TriMesh<'_>,
        skeleton: &Skeleton<'_>,
        resolution: f64,
        progress: &Progress,
        report: &mut Report,
    ) -> Result<Self> {
        let lattice = Lattice::new(mesh, resolution, progress)?;
        (report.cells, report.cell_size) = (lattice.len(), lattice.cells().size());
        let sources: Vec<Sources> = (0..skeleton.len()).map(|j| Sources::new(&lattice, skeleton.segment(j))).collect();
        report.bones_outside = (0..).zip(&sources).filter(|(_, s)| s.outside).map(|(j, _)| j).collect();
        progress.report(0.3);
        let surface = Surface::new(mesh, &lattice);
        let nearest = nearest_bone(&lattice, &sources);
        let reach = Paths::new(&lattice).distance_of(REACH * mesh.diagonal());
        let limit = |node: u32| nearest[node as usize].saturating_add(reach);
        let of_bone = |paths: &mut Paths<'_>, j: usize| {
            progress.check()?;
            paths.search(sources[j].starts(paths), limit);
            Ok(surface.candidates(paths, skeleton, j))
        };
        let found: Vec<_> =
            (0..skeleton.len()).into_par_iter().map_init(|| Paths::new(&lattice), of_bone).collect::<Result<_>>()?;
        progress.report(0.6);
        Ok(Self::by_vertex(&found, mesh.vertex_count(), skeleton.len() as u32))
    }

    fn by_vertex(found: &[Vec<Candidate>], vertex_count: usize, n_bones: u32) -> Self {
        let mut starts = vec![0; vertex_count + 1];
        for candidate in found.iter().flatten() {
            starts[candidate.vertex as usize + 1] += 1;
        }
        for i in 0..vertex_count {
            starts[i + 1] += starts[i];
        }
        let empty = Candidate { vertex: 0, bone: 0, distance: 0.0, effective: 0.0 };
        let (mut next, mut all) = (starts.clone(), vec![empty; starts[vertex_count]]);
        for candidate in found.iter().flatten() {
            all[next[candidate.vertex as usize]] = *candidate;
            next[candidate.vertex as usize] += 1;
        }
        Self { starts, all, n_bones }
    }

    /// The candidates of vertex `i`.
    pub(super) fn of(&self, i: usize) -> &[Candidate] {
        &self.all[self.starts[i]..self.starts[i + 1]]
    }
}

/// Where the ways from a bone start.
struct Sources {
    /// Nodes, and how far away the bone is from the middles of their cells.
    nodes: Vec<(u32, f64)>,
    /// Whether no part of the bone is inside.
    outside: bool,
}

impl Sources {
    /// The nodes along the bone, or those nearest to it where none is.
    fn new(lattice: &Lattice, [head, tail]: [DVec3; 2]) -> Self {
        let along = tail - head;
        let steps = (2.0 * along.length() / lattice.cells().size()).ceil().clamp(1.0, 1e5) as usize;
        let points = || (0..=steps).map(|k| head + along * (k as f64 / steps as f64));
        let mut nodes: Vec<u32> = points().filter_map(|p| lattice.node_at(p)).collect();
        let outside = nodes.is_empty();
        if outside {
            nodes.extend(points().map(|p| lattice.nearest_node(p)));
        }
        nodes.sort_unstable();
        nodes.dedup();
        let distance = |node: u32| {
            let middle = lattice.middle(node);
            let share = ((middle - head).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            (node, middle.distance(head + share * along))
        };
        Self { nodes: nodes.into_iter().map(distance).collect(), outside }
    }

    fn starts(&self, paths: &Paths<'_>) -> Vec<(u32, u32)> {
        self.nodes.iter().map(|&(node, distance)| (node, paths.distance_of(distance))).collect()
    }
}

/// Distance of the nearest bone to every node.
fn nearest_bone(lattice: &Lattice, sources: &[Sources]) -> Vec<u32> {
    let mut paths = Paths::new(lattice);
    let starts: Vec<_> = sources.iter().flat_map(|s| s.starts(&paths)).collect();
    paths.search(starts, |_| UNREACHED - 1);
    (0..lattice.len() as u32).map(|node| paths.distance(node)).collect()
}

/// The vertices, by the node that stands for each.
struct Surface<'a> {
    mesh: &'a TriMesh<'a>,
    lattice: &'a Lattice,
    normals: Vec<DVec3>,
    /// Vertices of each node.
    starts: Vec<u32>,
    vertices: Vec<u32>,
}

impl<'a> Surface<'a> {
    fn new(mesh: &'a TriMesh<'a>, lattice: &'a Lattice) -> Self {
        let normals: Vec<DVec3> = mesh.vertex_normals().iter().map(|n| n.as_dvec3()).collect();
        let node = |i: usize| lattice.node_below(mesh.position(i as u32), normals[i]);
        let node_of: Vec<u32> = (0..mesh.vertex_count()).into_par_iter().map(node).collect();
        let mut starts = vec![0u32; lattice.len() + 1];
        node_of.iter().for_each(|&node| starts[node as usize + 1] += 1);
        for node in 0..lattice.len() {
            starts[node + 1] += starts[node];
        }
        let mut vertices: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
        vertices.sort_by_key(|&i| node_of[i as usize]);
        Self { mesh, lattice, normals, starts, vertices }
    }

    /// All vertices that the ways from bone `j` reach.
    fn candidates(&self, paths: &Paths<'_>, skeleton: &Skeleton<'_>, j: usize) -> Vec<Candidate> {
        let mut found = Vec::new();
        for &node in paths.reached() {
            let vertices = self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize;
            let way = paths.length(paths.distance(node));
            found.extend(self.vertices[vertices].iter().map(|&i| self.candidate(i, skeleton, j, way)));
        }
        found
    }

    /// `way` is the length of the way to the vertex's node. Ways over a lattice are up to a tenth too long, so that a
    /// straight one is measured straight.
    fn candidate(&self, vertex: u32, skeleton: &Skeleton<'_>, j: usize, way: f64) -> Candidate {
        let position = self.mesh.position(vertex);
        let closest = skeleton.closest_point(j, position);
        let straight = position.distance(closest);
        let size = self.lattice.cells().size();
        let nearly_straight = way < 1.12 * straight + 1.8 * size;
        let distance = if nearly_straight || self.lattice.sees(position, closest, SLACK) {
            straight
        } else {
            straight.max(way - 0.5 * size)
        };
        let cosine = (position - closest).normalize_or_zero().dot(self.normals[vertex as usize]);
        Candidate { vertex, bone: j as u32, distance, effective: distance / facing(cosine) }
    }
}

/// How much a bone faces the surface, 1 where it lies straight below it, given the cosine of the angle between the normal and
/// the direction from the bone: what is beside or outside of the surface counts as farther away. Half of it is flat near 1,
/// so that of bones in a row, as of a spine, the nearest is taken and not the one that a slope points to; half is steeper,
/// which keeps the thin limbs of animals to their own bones.
fn facing(cosine: f64) -> f64 {
    let half = 0.5 * (1.0 + cosine);
    let steep = half * half;
    let flat = (steep * (3.0 - 2.0 * half)).powi(3);
    0.15 + 0.425 * (steep + flat)
}
