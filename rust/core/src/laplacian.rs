//! Cotangent stiffness and Voronoi mass of a triangle mesh, safe on any triangle.

use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;

use crate::adjacency::{Islands, NONE, Topology, VertexTriangles, Wires};
use crate::mesh::TriMesh;

/// Slack that mollification leaves in every triangle inequality, as a share of the island's mean edge.
const MOLLIFICATION: f64 = 1e-5;

/// Vertices or triangles a worker takes at a time.
const RUN: usize = 4096;

/// Stiffness S = -L (half cotangents, rows sum to zero, positive semi-definite) and lumped mixed Voronoi areas M
/// (Meyer et al. 2003). S is kept by row: `S_ij = -cotangent`, `S_ii = sum of the row's cotangents`.
#[derive(Debug)]
pub struct Laplacian {
    /// Where the workers have left them: to put the rows into arrays of the whole mesh took a third of the time.
    runs: Vec<Rows>,
}

/// What one triangle gives: half cotangent opposite to, and Voronoi area at, each corner.
#[derive(Debug, Clone, Copy, Default)]
struct Corners {
    half_cotangent: [f64; 3],
    area: [f64; 3],
}

impl Laplacian {
    /// Assembles S and M over the clean triangles of `mesh`.
    ///
    /// A triangle whose inequality holds with less than 1e-5 of its island's mean edge gets its three edge lengths
    /// increased until it does (intrinsic mollification, Sharp & Crane 2020, section 4.5, but per triangle, so that
    /// good triangles keep their cotangents to the bit). No value is ever NaN or infinite, and every mass is positive.
    ///
    /// A wire is a ribbon whose width is the mean length of its island's wires: the stiffness between its ends is width over
    /// length, and each gets half of its area.
    pub fn new(mesh: &TriMesh<'_>, topology: &Topology<'_>) -> Self {
        Self::with_floor(mesh, topology, 0.0)
    }

    /// The same with a `floor` under what collapsed triangles bring, so that a system with them can be solved: every triangle
    /// inequality holds with at least this share of the triangle's longest edge, and no mass is less than the floor's square
    /// times the mean mass of its island.
    pub fn with_floor(mesh: &TriMesh<'_>, topology: &Topology<'_>, floor: f64) -> Self {
        let Topology { triangles, around, wires, islands } = topology;
        let slack = island_slack(mesh, triangles, islands);
        let corners: Vec<Corners> = triangles
            .par_iter()
            .map(|t| {
                let slack = slack[islands.of_vertex()[t[0] as usize] as usize];
                Corners::new(t.map(|i| mesh.position(i)), slack, floor)
            })
            .collect();
        let least_mass = if floor > 0.0 { least_masses(triangles, &corners, islands, floor) } else { Vec::new() };
        let count = mesh.vertex_count();
        let ribbons = Ribbons::new(mesh, wires, islands);
        let run = |k: usize| {
            let mut rows = Rows::new(k * RUN..((k + 1) * RUN).min(count), triangles, around, &corners, &ribbons);
            rows.raise_masses(k * RUN, islands, &least_mass);
            rows
        };
        Self { runs: (0..count.div_ceil(RUN)).into_par_iter().map(run).collect() }
    }

    /// Neighbours of vertex `i`, ascending, and the summed half cotangents of the edges to them.
    pub fn row(&self, i: usize) -> (&[u32], &[f64]) {
        self.runs[i / RUN].row(i % RUN)
    }

    /// Neighbours of vertex `i`, ascending.
    pub fn neighbours(&self, i: usize) -> &[u32] {
        self.row(i).0
    }

    /// `S_ii` of vertex `i`.
    pub fn diagonal(&self, i: usize) -> f64 {
        self.runs[i / RUN].diagonal[i % RUN]
    }

    /// Voronoi area of vertex `i`, zero only where neither triangle nor wire uses it.
    pub fn mass(&self, i: usize) -> f64 {
        self.runs[i / RUN].mass[i % RUN]
    }
}

/// Smallest slack allowed in each island: a share of its mean edge, or any length at all where it has no size.
fn island_slack(mesh: &TriMesh<'_>, triangles: &[[u32; 3]], islands: &Islands) -> Vec<f64> {
    let island_of = |t: &[u32; 3]| islands.of_vertex()[t[0] as usize] as usize;
    let length_of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.position(i));
        a.distance(b) + b.distance(c) + c.distance(a)
    };
    let sum =
        |of_one: &[[u32; 3]]| (island_of(&of_one[0]), of_one.iter().map(length_of).sum::<f64>(), 3 * of_one.len());
    // Triangles that follow each other are mostly of one island.
    let of_run = |run: &[[u32; 3]]| run.chunk_by(|s, t| island_of(s) == island_of(t)).map(sum).collect::<Vec<_>>();
    let parts: Vec<_> = triangles.par_chunks(RUN).map(of_run).collect();
    let mut sums = vec![(0.0, 0usize); islands.count()];
    for (island, length, edges) in parts.into_iter().flatten() {
        sums[island].0 += length;
        sums[island].1 += edges;
    }
    let slack = |(length, edges)| if length > 0.0 { MOLLIFICATION * length / edges as f64 } else { 1.0 };
    sums.into_iter().map(slack).collect()
}

/// The square of `floor` times the mean mass of each island.
fn least_masses(triangles: &[[u32; 3]], corners: &[Corners], islands: &Islands, floor: f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0usize); islands.count()];
    for (t, corner) in std::iter::zip(triangles, corners) {
        sums[islands.of_vertex()[t[0] as usize] as usize].0 += corner.area.iter().sum::<f64>();
    }
    for &island in islands.of_vertex().iter().filter(|&&island| island != NONE) {
        sums[island as usize].1 += 1;
    }
    sums.into_iter().map(|(area, count)| floor * floor * area / count as f64).collect()
}

impl Corners {
    fn new(positions: [DVec3; 3], slack: f64, floor: f64) -> Self {
        let [a, b, c] = positions;
        let mut lengths = [b.distance(c), c.distance(a), a.distance(b)];
        let longest = lengths.iter().fold(0.0, |m: f64, &x| m.max(x));
        let missing = slack.max(floor * longest) - (lengths.iter().sum::<f64>() - 2.0 * longest);
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

/// Wires shorter than this share of their mean count as that long.
const SHORTEST_WIRE: f64 = 1e-2;

/// What wires add to S and M.
struct Ribbons<'a> {
    mesh: &'a TriMesh<'a>,
    wires: &'a Wires,
    islands: &'a Islands,
    /// Mean length of the wires of each island; empty if there are no wires.
    widths: Vec<f64>,
}

impl<'a> Ribbons<'a> {
    fn new(mesh: &'a TriMesh<'a>, wires: &'a Wires, islands: &'a Islands) -> Self {
        let mut sums = vec![(0.0, 0usize); if wires.edges.is_empty() { 0 } else { islands.count() }];
        for &[i, j] in &wires.edges {
            let sum = &mut sums[islands.of_vertex()[i as usize] as usize];
            (sum.0, sum.1) = (sum.0 + mesh.position(i).distance(mesh.position(j)), sum.1 + 1);
        }
        let mean = |(length, count): (f64, usize)| if length > 0.0 { length / count as f64 } else { 1.0 };
        Self { mesh, wires, islands, widths: sums.into_iter().map(mean).collect() }
    }

    /// Adds the wires at vertex `i` to its row; the area that they bring.
    fn add_to(&self, i: usize, entries: &mut Vec<(u32, f64)>) -> f64 {
        let mut area = 0.0;
        for &j in self.wires.around(i) {
            let width = self.widths[self.islands.of_vertex()[i] as usize];
            let length = self.mesh.position(i as u32).distance(self.mesh.position(j)).max(SHORTEST_WIRE * width);
            entries.push((j, width / length));
            area += 0.5 * width * length;
        }
        area
    }
}

/// The rows of S and M of a run of vertices.
#[derive(Debug)]
struct Rows {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    cotangents: Vec<f64>,
    diagonal: Vec<f64>,
    mass: Vec<f64>,
}

impl Rows {
    fn new(
        vertices: Range<usize>,
        triangles: &[[u32; 3]],
        around: &VertexTriangles,
        corners: &[Corners],
        ribbons: &Ribbons<'_>,
    ) -> Self {
        // One neighbour for each triangle, and one more at a border.
        let likely = vertices.clone().map(|i| around.around(i).len() + 1).sum();
        let mut rows = Self {
            starts: Vec::with_capacity(vertices.len() + 1),
            neighbours: Vec::with_capacity(likely),
            cotangents: Vec::with_capacity(likely),
            diagonal: Vec::with_capacity(vertices.len()),
            mass: Vec::with_capacity(vertices.len()),
        };
        rows.starts.push(0);
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
            mass += ribbons.add_to(i, &mut entries);
            entries.sort_by_key(|&(j, _)| j);
            rows.push(&entries, mass);
        }
        rows
    }

    /// Raises the masses of the run that starts at vertex `first` to the least of their island, if there is such a thing.
    fn raise_masses(&mut self, first: usize, islands: &Islands, least: &[f64]) {
        for (k, mass) in self.mass.iter_mut().enumerate() {
            if let Some(&least) = least.get(islands.of_vertex()[first + k] as usize) {
                *mass = mass.max(least);
            }
        }
    }

    fn push(&mut self, entries: &[(u32, f64)], mass: f64) {
        for edge in entries.chunk_by(|x, y| x.0 == y.0) {
            self.neighbours.push(edge[0].0);
            self.cotangents.push(edge.iter().map(|e| e.1).sum());
        }
        let start = self.starts[self.mass.len()] as usize;
        self.diagonal.push(self.cotangents[start..].iter().sum());
        self.mass.push(mass);
        self.starts.push(self.neighbours.len() as u32);
    }

    fn row(&self, k: usize) -> (&[u32], &[f64]) {
        let range = self.starts[k] as usize..self.starts[k + 1] as usize;
        (&self.neighbours[range.clone()], &self.cotangents[range])
    }
}
