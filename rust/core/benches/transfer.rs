//! The stages of a transfer on a garment of 100,000 vertices, 40 % of them unmatched in a few blobs.

#[path = "../tests/common/mod.rs"]
#[allow(dead_code, reason = "the tests use the rest")]
mod common;

use common::{Fixture, body, tube};
use divan::Bencher;
use skinwright_core::adjacency::Topology;
use skinwright_core::fill::{Constraint, Fill};
use skinwright_core::laplacian::Laplacian;
use skinwright_core::transfer::{Inpainting, Settings, Source, TargetMesh};
use skinwright_core::{Progress, TriMesh, Weights};

fn main() {
    divan::main();
}

/// 500 x 200 vertices; every third of the way round it stands off the body.
fn garment() -> Fixture {
    tube(500, 200).mapped(|p| {
        let stands_off = (3.0 * p.y.atan2(p.x)).sin() > 0.3;
        let out = if stands_off { 1.6 } else { 1.01 };
        glam::DVec3::new(p.x * out, p.y * out, p.z)
    })
}

fn source() -> Source {
    let (body, rows) = body();
    let mut indptr = vec![0];
    rows.iter().for_each(|(bones, _)| indptr.push(indptr[indptr.len() - 1] + bones.len() as u32));
    let (bones, values) = rows.into_iter().unzip::<_, _, Vec<_>, Vec<_>>();
    let weights = Weights::new(indptr, bones.concat(), values.concat(), 4).unwrap();
    Source::new(&body.positions, body.triangles, weights).unwrap()
}

fn target_mesh(fixture: &Fixture) -> TargetMesh {
    TargetMesh { positions: fixture.positions.clone(), triangles: fixture.triangles.clone(), edges: Vec::new() }
}

#[divan::bench]
fn laplacian(bencher: Bencher) {
    let garment = garment();
    let mesh = TriMesh::new(&garment.positions, &garment.triangles, "target").unwrap();
    bencher.bench_local(|| Laplacian::new(&mesh, &Topology::new(&garment.triangles, garment.positions.len())));
}

#[divan::bench]
fn blocks_and_assembly(bencher: Bencher) {
    let garment = garment();
    let progress = Progress::default();
    let mut prepared = Inpainting::new(source(), target_mesh(&garment), &Settings::default(), &progress).unwrap();
    let matched = prepared.matched(None, &Settings::default()).unwrap();
    let constraints: Vec<Constraint> =
        matched.iter().map(|&matched| if matched { Constraint::Fixed } else { Constraint::Free }).collect();
    let mut fill = Fill::new(garment.positions, garment.triangles, None).unwrap();
    bencher.bench_local(move || fill.assemble(constraints.clone(), 0.1, &progress).unwrap());
}

#[divan::bench(args = [0, 10])]
fn solve_kept(bencher: Bencher, smoothing_iterations: u32) {
    let garment = garment();
    let progress = Progress::default();
    let mut prepared = Inpainting::new(source(), target_mesh(&garment), &Settings::default(), &progress).unwrap();
    let settings = Settings { smoothing_iterations, ..Settings::default() };
    prepared.solve(None, &settings, &progress).unwrap();
    bencher.bench_local(move || prepared.solve(None, &settings, &progress).unwrap());
}

#[divan::bench]
fn all(bencher: Bencher) {
    let (garment, source, progress) = (garment(), source(), Progress::default());
    bencher.bench_local(|| {
        let mut prepared =
            Inpainting::new(source.clone(), target_mesh(&garment), &Settings::default(), &progress).unwrap();
        prepared.solve(None, &Settings::default(), &progress).unwrap()
    });
}
