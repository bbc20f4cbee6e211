//! Building the index and asking it, on a wavy torus with offsets as between a body and its clothes.

use divan::{Bencher, black_box};
use skinwright_core::TriMesh;
use skinwright_core::surface::SurfaceIndex;

fn main() {
    divan::main();
}

/// Triangles along each way round the torus, halved.
const SIDES: [u32; 3] = [160, 320, 500];

/// A point of the torus (about 2 units across, waves of 1 to 2 %), `offset` above its surface.
fn on_torus(u: f32, v: f32, offset: f32) -> [f32; 3] {
    let radius = 0.3 + 0.02 * (9.0 * u).sin() * (5.0 * v).cos() + offset;
    let ring = 0.7 + radius * v.cos();
    [ring * u.cos(), ring * u.sin(), radius * v.sin()]
}

struct Torus {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Torus {
    /// Of 2 side^2 triangles.
    fn new(side: u32) -> Self {
        let angle = |i: u32| i as f32 * std::f32::consts::TAU / side as f32;
        let positions = (0..side * side).map(|i| on_torus(angle(i / side), angle(i % side), 0.0)).collect();
        let at = |i: u32, j: u32| (i % side) * side + j % side;
        let cell = |n: u32| [n / side, n % side];
        let halves =
            |[i, j]: [u32; 2]| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
        Self { positions, triangles: (0..side * side).map(cell).flat_map(halves).collect() }
    }

    fn mesh(&self) -> TriMesh<'_> {
        TriMesh::new(&self.positions, &self.triangles, "torus").expect("a good mesh")
    }
}

/// 100,000 points in no order, `spread` of the way from the surface to anywhere around it.
fn queries(spread: f32) -> Vec<[f32; 3]> {
    let unit = |i: u32, by: f32| (i as f32 * by).fract();
    let place = |i: u32| {
        let angles = [unit(i, 0.618_034), unit(i, 0.754_877_7)].map(|x| x * std::f32::consts::TAU);
        on_torus(angles[0], angles[1], 0.01 + 0.03 * unit(i, 0.414_213_6) + spread * unit(i, 0.236_068))
    };
    (0..100_000).map(place).collect()
}

#[divan::bench(args = SIDES, sample_count = 15)]
fn build(bencher: Bencher, side: u32) {
    let torus = Torus::new(side);
    bencher.bench(|| SurfaceIndex::new(black_box(&torus.mesh())));
}

#[divan::bench(args = SIDES, sample_count = 15)]
fn near_the_surface(bencher: Bencher, side: u32) {
    let index = SurfaceIndex::new(&Torus::new(side).mesh());
    let queries = queries(0.0);
    bencher.counter(queries.len()).bench(|| index.closest_points(black_box(&queries)));
}

#[divan::bench(args = SIDES, sample_count = 15)]
fn far_from_the_surface(bencher: Bencher, side: u32) {
    let index = SurfaceIndex::new(&Torus::new(side).mesh());
    let queries = queries(0.5);
    bencher.counter(queries.len()).bench(|| index.closest_points(black_box(&queries)));
}

#[divan::bench(args = SIDES, sample_count = 15)]
fn vertex_normals(bencher: Bencher, side: u32) {
    let torus = Torus::new(side);
    bencher.bench(|| black_box(torus.mesh()).vertex_normals());
}
