//! Cotangent stiffness and Voronoi mass of a triangle mesh, safe on any triangle.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use crate::adjacency::{Islands, VertexTriangles};
use crate::mesh::TriMesh;

/// Slack that mollification leaves in every triangle inequality, as a share of the island's mean edge.
const MOLLIFICATION: f64 = 1e-5;

/// Vertices a worker takes at a time.
const CHUNK: usize = 4096;

/// Stiffness S = -L (half cotangents, rows sum to zero, positive semi-definite) and lumped mixed Voronoi areas M
/// (Meyer et al. 2003). S is kept by row: `S_ij = -cotangent`, `S_ii = sum of the row's cotangents`.
#[derive(Debug)]
pub struct Laplacian {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    cotangents: Vec<f64>,
    diagonal: Vec<f64>,
    mass: Vec<f64>,
}

/// What one triangle gives: half cotangent opposite to, and Voronoi area at, each corner.
#[derive(Debug, Clone, Copy, Default)]
struct Corners {
    half_cotangent: [f64; 3],
    area: [f64; 3],
}

impl Laplacian {
    /// Assembles S and M over clean `triangles` (no repeated vertex, no duplicates) of `mesh`.
    ///
    /// A triangle whose inequality holds with less than 1e-5 of its island's mean edge gets its three edge lengths
    /// increased until it does (intrinsic mollification, Sharp & Crane 2020, section 4.5, but per triangle, so that
    /// good triangles keep their cotangents to the bit). No value is ever NaN or infinite, and every mass is positive.
    pub fn new(mesh: &TriMesh<'_>, triangles: &[[u32; 3]], around: &VertexTriangles, islands: &Islands) -> Self {
        let slack = island_slack(mesh, triangles, islands);
        let corners: Vec<Corners> = triangles
            .par_iter()
            .map(|t| Corners::new(t.map(|i| mesh.position(i)), slack[islands.of_vertex()[t[0] as usize] as usize]))
            .collect();
        let count = mesh.vertex_count();
        let run = |k: usize| k * CHUNK..((k + 1) * CHUNK).min(count);
        let rows = |k| Rows::new(run(k), triangles, around, &corners);
        Self::concatenate((0..count.div_ceil(CHUNK)).into_par_iter().map(rows).collect(), count)
    }

    fn concatenate(parts: Vec<Rows>, vertex_count: usize) -> Self {
        let nnz = parts.iter().map(|part| part.neighbours.len()).sum();
        let mut out = Self {
            starts: Vec::with_capacity(vertex_count + 1),
            neighbours: Vec::with_capacity(nnz),
            cotangents: Vec::with_capacity(nnz),
            diagonal: Vec::with_capacity(vertex_count),
            mass: Vec::with_capacity(vertex_count),
        };
        out.starts.push(0);
        for part in parts {
            let offset = out.neighbours.len() as u32;
            out.starts.extend(part.ends.iter().map(|end| offset + end));
            out.neighbours.extend(part.neighbours);
            out.cotangents.extend(part.cotangents);
            out.diagonal.extend(part.diagonal);
            out.mass.extend(part.mass);
        }
        out
    }

    /// Neighbours of vertex `i`, ascending, and the summed half cotangents of the edges to them.
    pub fn row(&self, i: usize) -> (&[u32], &[f64]) {
        let range = self.starts[i] as usize..self.starts[i + 1] as usize;
        (&self.neighbours[range.clone()], &self.cotangents[range])
    }

    /// Neighbours of vertex `i`, ascending.
    pub fn neighbours(&self, i: usize) -> &[u32] {
        self.row(i).0
    }

    /// `S_ii`, (V).
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// Voronoi area of each vertex (V), zero only where no triangle uses the vertex.
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }
}

/// Smallest slack allowed in each island: a share of its mean edge, or any length at all where it has no size.
fn island_slack(mesh: &TriMesh<'_>, triangles: &[[u32; 3]], islands: &Islands) -> Vec<f64> {
    let mut sums = vec![(0.0, 0usize); islands.count()];
    for t in triangles {
        let [a, b, c] = t.map(|i| mesh.position(i));
        let (length, edges) = &mut sums[islands.of_vertex()[t[0] as usize] as usize];
        *length += a.distance(b) + b.distance(c) + c.distance(a);
        *edges += 3;
    }
    let slack = |(length, edges)| if length > 0.0 { MOLLIFICATION * length / edges as f64 } else { 1.0 };
    sums.into_iter().map(slack).collect()
}

impl Corners {
    fn new(positions: [DVec3; 3], slack: f64) -> Self {
        let [a, b, c] = positions;
        let mut lengths = [b.distance(c), c.distance(a), a.distance(b)];
        let longest = lengths.iter().fold(0.0, |m: f64, &x| m.max(x));
        let missing = slack - (lengths.iter().sum::<f64>() - 2.0 * longest);
        if missing > 0.0 {
            lengths = lengths.map(|x| x + missing);
        }
        let doubled_area = if missing > 0.0 { doubled_area_of_lengths(lengths) } else { (b - a).cross(c - a).length() };
        let [a2, b2, c2] = lengths.map(|x| x * x);
        let half_cotangent = [b2 + c2 - a2, c2 + a2 - b2, a2 + b2 - c2].map(|dot| dot / (4.0 * doubled_area));
        Self { half_cotangent, area: voronoi_areas(half_cotangent, [a2, b2, c2], 0.5 * doubled_area) }
    }
}

/// Twice the area of a triangle with these edge lengths (Kahan's form of Heron's formula).
fn doubled_area_of_lengths(mut lengths: [f64; 3]) -> f64 {
    lengths.sort_unstable_by(f64::total_cmp);
    let [c, b, a] = lengths;
    0.5 * ((a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))).max(0.0).sqrt()
}

/// Mixed Voronoi area at each corner (Meyer et al. 2003, section 3.3): half the triangle at an obtuse corner, a
/// quarter at the two others.
fn voronoi_areas(half_cotangent: [f64; 3], squared: [f64; 3], area: f64) -> [f64; 3] {
    if let Some(obtuse) = half_cotangent.iter().position(|&x| x < 0.0) {
        return std::array::from_fn(|k| if k == obtuse { 0.5 * area } else { 0.25 * area });
    }
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        0.25 * (squared[i] * half_cotangent[i] + squared[j] * half_cotangent[j])
    })
}

/// The rows of S and M of a run of vertices.
#[derive(Default)]
struct Rows {
    ends: Vec<u32>,
    neighbours: Vec<u32>,
    cotangents: Vec<f64>,
    diagonal: Vec<f64>,
    mass: Vec<f64>,
}

impl Rows {
    fn new(vertices: Range<usize>, triangles: &[[u32; 3]], around: &VertexTriangles, corners: &[Corners]) -> Self {
        let mut rows = Self::default();
        let mut entries: Vec<(u32, f64)> = Vec::new();
        for i in vertices {
            entries.clear();
            let mut mass = 0.0;
            for &t in around.around(i) {
                let (corner, triangle) = (&corners[t as usize], &triangles[t as usize]);
                let k = triangle.iter().position(|&x| x as usize == i).expect("the triangle is around the vertex");
                let (next, previous) = ((k + 1) % 3, (k + 2) % 3);
                entries.push((triangle[next], corner.half_cotangent[previous]));
                entries.push((triangle[previous], corner.half_cotangent[next]));
                mass += corner.area[k];
            }
            entries.sort_by_key(|&(j, _)| j);
            rows.push(&entries, mass);
        }
        rows
    }

    fn push(&mut self, entries: &[(u32, f64)], mass: f64) {
        for edge in entries.chunk_by(|x, y| x.0 == y.0) {
            self.neighbours.push(edge[0].0);
            self.cotangents.push(edge.iter().map(|e| e.1).sum());
        }
        let start = self.ends.last().map_or(0, |&end| end as usize);
        self.diagonal.push(self.cotangents[start..].iter().sum());
        self.mass.push(mass);
        self.ends.push(self.neighbours.len() as u32);
    }
}
