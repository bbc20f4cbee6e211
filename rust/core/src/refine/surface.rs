//! The skin's surface for the solver: vertices at one place are one, with their neighbours and rest lengths.

use glam::{DVec3, Vec3};

use super::morton::morton;
use crate::adjacency::DisjointSets;
use crate::mesh::TriMesh;
use crate::weld::Weld;

/// Vertices are one within this share of the bounding box' diagonal: what rounding makes of one place.
const COINCIDENT: f64 = 1e-7;
/// Steps of the Morton curve's grid along the bounding box' diagonal.
const STEPS: f64 = (1 << 20) as f64;

/// Welded vertices, their triangles and rings. Split seams of a mesh (UV, sharp edges) are closed by it.
#[derive(Debug)]
pub(super) struct Surface {
    /// Place of each welded vertex at rest.
    pub(super) rest: Vec<DVec3>,
    /// Welded vertex of each vertex of the mesh.
    pub(super) of_vertex: Vec<u32>,
    /// A vertex of the mesh for each welded one.
    pub(super) source: Vec<u32>,
    /// Triangles over welded vertices, by their smallest one; those that name one twice are dropped.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The connected component of each welded vertex, and how many there are.
    pub(super) island: Vec<u32>,
    pub(super) islands: usize,
    /// Whether every edge has one triangle on each side, so that what is enclosed has a volume.
    pub(super) is_closed: bool,
    /// Neighbours along edges, compressed by vertex, ascending.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// Edges, each once, the smaller vertex first.
    pub(super) edges: Vec<[u32; 2]>,
}

impl Surface {
    pub(super) fn new(mesh: &TriMesh<'_>) -> Self {
        let (of_vertex, source) = weld(mesh);
        let rest = source.iter().map(|&i| Vec3::from(mesh.positions()[i as usize]).as_dvec3()).collect();
        let welded = mesh.triangles().iter().map(|t| t.map(|i| of_vertex[i as usize]));
        let mut triangles: Vec<_> = welded.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        // Along the vertices' curve as well: boxes of neighbours are compared together.
        triangles.sort_by_key(|t| t[0].min(t[1]).min(t[2]));
        let edges = edges_of(&triangles);
        let (starts, neighbours) = rings(&edges, source.len());
        let mut sets = DisjointSets::new(source.len());
        edges.iter().for_each(|&[i, j]| sets.union(i, j));
        let (island, islands) = sets.number(|i| starts[i as usize] < starts[i as usize + 1]);
        let is_closed = is_closed(&triangles);
        Self { rest, of_vertex, source, triangles, island, islands, is_closed, starts, neighbours, edges }
    }

    pub(super) fn len(&self) -> usize {
        self.rest.len()
    }

    /// The signed volume enclosed by the triangles with vertices at `at`, if the surface is closed.
    pub(super) fn volume(&self, at: impl Fn(u32) -> DVec3) -> f64 {
        self.triangles.iter().map(|t| t.map(&at)).map(|[a, b, c]| a.dot(b.cross(c))).sum::<f64>() / 6.0
    }

    /// The vertices that share an edge with vertex `i`.
    pub(super) fn ring(&self, i: usize) -> &[u32] {
        &self.neighbours[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
}

/// Welded vertex of each vertex, and a vertex for each welded one; welded vertices are numbered along a Morton curve.
fn weld(mesh: &TriMesh<'_>) -> (Vec<u32>, Vec<u32>) {
    let positions = mesh.positions();
    let all = || (0..positions.len() as u32).collect::<Vec<_>>();
    let weld = Weld::coincident(positions, COINCIDENT * mesh.diagonal()).unwrap_or_else(|| Weld::new(&all()));
    let first: Vec<u32> = weld.representatives().collect();
    let low = positions.iter().fold(Vec3::INFINITY, |low, &p| low.min(p.into())).as_dvec3();
    let scale = STEPS / mesh.diagonal().max(f64::MIN_POSITIVE);
    let place = |class: u32| {
        let steps = (Vec3::from(positions[first[class as usize] as usize]).as_dvec3() - low) * scale;
        morton(steps.as_ivec3().to_array())
    };
    let mut order: Vec<u32> = (0..first.len() as u32).collect();
    order.sort_by_cached_key(|&class| (place(class), class));
    let mut number = vec![0; order.len()];
    order.iter().enumerate().for_each(|(n, &class)| number[class as usize] = n as u32);
    let of_vertex = weld.class_of().iter().map(|&class| number[class as usize]).collect();
    (of_vertex, order.iter().map(|&class| first[class as usize]).collect())
}

fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut sides: Vec<[u32; 2]> = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
    sides.sort_unstable();
    let once = sides.windows(2).all(|pair| pair[0] != pair[1]);
    once && sides.iter().all(|&[i, j]| sides.binary_search(&[j, i]).is_ok())
}

fn edges_of(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]].map(|[i, j]| [i.min(j), i.max(j)]);
    let mut edges: Vec<_> = triangles.iter().flat_map(sides).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

fn rings(edges: &[[u32; 2]], count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut both: Vec<[u32; 2]> = edges.iter().flat_map(|&[i, j]| [[i, j], [j, i]]).collect();
    both.sort_unstable();
    let mut starts = vec![0u32; count + 1];
    for &[i, _] in &both {
        starts[i as usize + 1] += 1;
    }
    for i in 0..count {
        starts[i + 1] += starts[i];
    }
    (starts, both.iter().map(|pair| pair[1]).collect())
}
