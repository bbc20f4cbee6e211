//! The skin's surface for the solver: vertices at one place are one, with their neighbours and rest lengths.

use glam::{DVec3, Vec3};

use super::holes::{Rim, fan, rims};
use super::morton::morton;
use crate::adjacency::DisjointSets;
use crate::mesh::TriMesh;
use crate::weld::Weld;

/// Vertices are one within this share of the bounding box' diagonal: what rounding makes of one place.
const COINCIDENT: f64 = 1e-7;
/// Steps of the Morton curve's grid along the bounding box' diagonal.
const STEPS: f64 = (1 << 20) as f64;

/// Area of the fans that close a component's openings beyond which it is a sheet, as a share of its own.
const MOST_OPEN: f64 = 1.0 / 3.0;

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
    /// The openings of components that enclose a volume nevertheless.
    pub(super) rims: Vec<Rim>,
    /// Whether each component encloses a volume, and whether most of the skin does.
    pub(super) is_solid: Vec<bool>,
    pub(super) is_mostly_solid: bool,
    /// Neighbours along edges, compressed by vertex, ascending.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// Edges, each once, the smaller vertex first.
    pub(super) edges: Vec<[u32; 2]>,
}

impl Surface {
    pub(super) fn new(mesh: &TriMesh<'_>) -> Self {
        let (of_vertex, source) = weld(mesh);
        let rest: Vec<DVec3> = source.iter().map(|&i| Vec3::from(mesh.positions()[i as usize]).as_dvec3()).collect();
        let welded = mesh.triangles().iter().map(|t| t.map(|i| of_vertex[i as usize]));
        let mut triangles: Vec<_> = welded.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        // Along the vertices' curve as well: boxes of neighbours are compared together.
        triangles.sort_by_key(|t| t[0].min(t[1]).min(t[2]));
        let edges = edges_of(&triangles);
        let (starts, neighbours) = rings(&edges, source.len());
        let mut sets = DisjointSets::new(source.len());
        edges.iter().for_each(|&[i, j]| sets.union(i, j));
        let (island, islands) = sets.number(|i| starts[i as usize] < starts[i as usize + 1]);
        let of_skin = |vertex: u32| island[vertex as usize] as usize;
        let mut rims = rims(&triangles, source.len());
        let areas = areas(&triangles, &rims, islands, of_skin, |i| rest[i as usize]);
        let is_solid: Vec<bool> = areas.iter().map(|[skin, open]| *open <= MOST_OPEN * skin).collect();
        rims.retain(|rim| is_solid[of_skin(rim[0][0])]);
        let solid: f64 =
            areas.iter().zip(&is_solid).filter(|(_, is_solid)| **is_solid).map(|([skin, _], _)| skin).sum();
        let is_mostly_solid = solid > areas.iter().map(|[skin, _]| skin).sum::<f64>() / 2.0;
        Self {
            rest,
            of_vertex,
            source,
            triangles,
            island,
            islands,
            rims,
            is_solid,
            is_mostly_solid,
            starts,
            neighbours,
            edges,
        }
    }

    /// The connected component of a triangle.
    pub(super) fn island_of(&self, triangle: u32) -> u32 {
        self.island[self.triangles[triangle as usize][0] as usize]
    }

    pub(super) fn len(&self) -> usize {
        self.rest.len()
    }

    /// The signed volume that each component encloses with vertices at `at`, openings closed; 0 for sheets.
    pub(super) fn volumes(&self, at: impl Fn(u32) -> DVec3) -> Vec<f64> {
        let mut volumes = vec![0.0; self.islands];
        let mut add = |vertex: u32, [a, b, c]: [DVec3; 3]| {
            volumes[self.island[vertex as usize] as usize] += a.dot(b.cross(c)) / 6.0;
        };
        self.triangles.iter().for_each(|t| add(t[0], t.map(&at)));
        self.rims.iter().for_each(|rim| fan(rim, &at).for_each(|t| add(rim[0][0], t)));
        let sheets = volumes.iter_mut().zip(&self.is_solid).filter(|(_, is_solid)| !**is_solid);
        sheets.for_each(|(volume, _)| *volume = 0.0);
        volumes
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

/// The area of each of `count` components, and of the fans that close its openings.
fn areas(
    triangles: &[[u32; 3]],
    rims: &[Rim],
    count: usize,
    component: impl Fn(u32) -> usize,
    at: impl Fn(u32) -> DVec3,
) -> Vec<[f64; 2]> {
    let mut areas = vec![[0.0; 2]; count];
    triangles.iter().for_each(|t| areas[component(t[0])][0] += area(t.map(&at)));
    rims.iter().for_each(|rim| areas[component(rim[0][0])][1] += fan(rim, &at).map(area).sum::<f64>());
    areas
}

fn area([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length() / 2.0
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
