//! Which tetrahedra the surface passes through.

use glam::DVec3;
use rayon::prelude::*;

use super::tetrahedron::Tetrahedron;

/// Samples per cell along a triangle's longest edge.
const SAMPLES_PER_CELL: f64 = 3.0;

/// A triangle in a tetrahedron, and a point of it there (cells).
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    pub(super) tetrahedron: Tetrahedron,
    pub(super) triangle: u32,
    pub(super) sample: DVec3,
}

/// All crossings, sorted by tetrahedron and triangle; `places` in cells.
///
/// Triangles are sampled, which may miss a tetrahedron that one only grazes; those of all vertices are found.
pub(super) fn crossings(places: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Crossing> {
    let of_triangle = |(triangle, corners): (usize, &[u32; 3])| {
        let mut found: Vec<_> = samples(corners.map(|i| places[i as usize]))
            .map(|sample| Crossing { tetrahedron: Tetrahedron::at(sample), triangle: triangle as u32, sample })
            .collect();
        found.sort_by_key(|crossing| crossing.tetrahedron);
        found.dedup_by_key(|crossing| crossing.tetrahedron);
        found
    };
    let mut crossings: Vec<_> = triangles.par_iter().enumerate().flat_map_iter(of_triangle).collect();
    crossings.par_sort_unstable_by_key(|crossing| (crossing.tetrahedron, crossing.triangle));
    crossings
}

fn samples([a, b, c]: [DVec3; 3]) -> impl Iterator<Item = DVec3> {
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let n = (longest * SAMPLES_PER_CELL).ceil().clamp(1.0, 1e4) as usize;
    let step = 1.0 / n as f64;
    (0..=n).flat_map(move |i| (0..=n - i).map(move |j| (i as f64 * step, j as f64 * step))).map(move |(u, v)| {
        // Corners to the bit, so that a vertex is found where it is looked for.
        match (u, v) {
            (0.0, 0.0) => a,
            (1.0, _) => b,
            (_, 1.0) => c,
            _ => a + (b - a) * u + (c - a) * v,
        }
    })
}
