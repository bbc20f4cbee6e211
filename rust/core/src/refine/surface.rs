//! The skin's surface for the solver: vertices at one place are one, with their neighbours and rest lengths.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::mesh::TriMesh;

/// Welded vertices, their triangles and rings. Split seams of a mesh (UV, sharp edges) are closed by it.
#[derive(Debug)]
pub(super) struct Surface {
    /// Place of each welded vertex at rest.
    pub(super) rest: Vec<DVec3>,
    /// Welded vertex of each vertex of the mesh.
    pub(super) of_vertex: Vec<u32>,
    /// A vertex of the mesh for each welded one.
    pub(super) source: Vec<u32>,
    /// Triangles over welded vertices; those that name one twice are dropped.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Neighbours along edges, compressed by vertex, ascending.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// Edges, each once, the smaller vertex first.
    pub(super) edges: Vec<[u32; 2]>,
}

impl Surface {
    pub(super) fn new(mesh: &TriMesh<'_>) -> Self {
        let (of_vertex, source) = weld(mesh.positions());
        let rest = source.iter().map(|&i| Vec3::from(mesh.positions()[i as usize]).as_dvec3()).collect();
        let welded = mesh.triangles().iter().map(|t| t.map(|i| of_vertex[i as usize]));
        let triangles: Vec<_> = welded.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let edges = edges_of(&triangles);
        let (starts, neighbours) = rings(&edges, source.len());
        Self { rest, of_vertex, source, triangles, starts, neighbours, edges }
    }

    pub(super) fn len(&self) -> usize {
        self.rest.len()
    }

    /// The vertices that share an edge with vertex `i`.
    pub(super) fn ring(&self, i: usize) -> &[u32] {
        &self.neighbours[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
}

fn weld(positions: &[[f32; 3]]) -> (Vec<u32>, Vec<u32>) {
    let mut first: HashMap<[u32; 3], u32> = HashMap::with_capacity(positions.len());
    let (mut of_vertex, mut source) = (Vec::with_capacity(positions.len()), Vec::new());
    for (i, p) in positions.iter().enumerate() {
        // Adding zero makes one of both zeros.
        let welded = *first.entry(p.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
            source.push(i as u32);
            source.len() as u32 - 1
        });
        of_vertex.push(welded);
    }
    (of_vertex, source)
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
