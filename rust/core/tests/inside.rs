//! Winding numbers against brute force (the sum of all solid angles, by another formula), and the inside test on meshes of
//! every kind.

mod common;

use common::{Fixture, degenerate, noise, rigid_motion, tube};
use glam::{DVec3, Vec3};
use skinwright_core::inside::Winding;
use skinwright_core::{Error, Progress, TriMesh};

/// What the library promises.
const TOLERANCE: f64 = 2e-3;

fn corners(mesh: &Fixture, t: usize) -> [DVec3; 3] {
    mesh.triangles[t].map(|i| Vec3::from(mesh.positions[i as usize]).as_dvec3())
}

/// Sum of all solid angles over 4 pi, each as the excess of a spherical triangle by L'Huilier's formula.
fn brute_force(mesh: &Fixture, query: DVec3) -> f64 {
    let excess = |t: usize| {
        let [a, b, c] = corners(mesh, t).map(|x| (x - query).normalize());
        let side = |u: DVec3, v: DVec3| 2.0 * (0.5 * (u - v).length()).min(1.0).asin();
        let (x, y, z) = (side(b, c), side(c, a), side(a, b));
        let s = 0.5 * (x + y + z);
        let product = (0.5 * s).tan() * (0.5 * (s - x)).tan() * (0.5 * (s - y)).tan() * (0.5 * (s - z)).tan();
        4.0 * product.max(0.0).sqrt().atan() * a.dot(b.cross(c)).signum()
    };
    (0..mesh.triangles.len()).map(excess).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

fn winding(mesh: &Fixture) -> Winding {
    Winding::new(&TriMesh::new(&mesh.positions, &mesh.triangles, "test").unwrap())
}

/// A sphere of `2 * around * (along - 1)` triangles, closed.
fn sphere(around: usize, along: usize) -> Fixture {
    let ring = |r: usize| std::f64::consts::PI * r as f64 / along as f64;
    let point = |r: usize, s: usize| {
        let angle = std::f64::consts::TAU * s as f64 / around as f64;
        DVec3::new(ring(r).sin() * angle.cos(), ring(r).sin() * angle.sin(), ring(r).cos()).as_vec3().to_array()
    };
    let mut positions = vec![[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
    positions.extend((1..along).flat_map(|r| (0..around).map(move |s| point(r, s))));
    let at = |r: usize, s: usize| match r {
        0 => 0,
        r if r == along => 1,
        r => (2 + (r - 1) * around + s % around) as u32,
    };
    let quads = (0..along).flat_map(|r| (0..around).map(move |s| (r, s)));
    let both = quads
        .flat_map(|(r, s)| [[at(r, s), at(r + 1, s), at(r + 1, s + 1)], [at(r, s), at(r + 1, s + 1), at(r, s + 1)]]);
    let triangles = both.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    Fixture::new("sphere", positions, triangles)
}

/// Triangles that have nothing to do with each other.
fn soup(count: u64) -> Fixture {
    let corner = |k: u64| {
        let [x, y, z] = [0, 1, 2].map(|axis| noise(k / 3, axis) * 4.0 + 0.3 * noise(k, axis + 3));
        [x as f32, y as f32, z as f32]
    };
    let triangles = (0..count as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    Fixture::new("soup", (0..3 * count).map(corner).collect(), triangles)
}

/// Points in and around the mesh's box.
fn queries(mesh: &Fixture, count: u64) -> Vec<[f32; 3]> {
    let points = || mesh.positions.iter().map(|&p| Vec3::from(p));
    let low = points().fold(Vec3::INFINITY, Vec3::min);
    let size = points().fold(Vec3::NEG_INFINITY, Vec3::max) - low;
    let share = |k: u64, axis: u64| noise(k, 40 + axis) as f32 * 1.4 - 0.2;
    (0..count).map(|k| (low + size * Vec3::new(share(k, 0), share(k, 1), share(k, 2))).to_array()).collect()
}

#[test]
fn equals_the_sum_of_solid_angles() {
    let meshes = [sphere(40, 30), tube(40, 50), soup(3000), sphere(30, 20).joined(tube(30, 30)).named("overlap")];
    for mesh in meshes {
        let (winding, queries) = (winding(&mesh), queries(&mesh, 400));
        for (query, number) in queries.iter().zip(winding.numbers(&queries, &Progress::default()).unwrap()) {
            let exact = brute_force(&mesh, Vec3::from(*query).as_dvec3());
            assert!((number - exact).abs() < TOLERANCE, "{}: {number} instead of {exact} at {query:?}", mesh.name);
        }
    }
}

#[test]
fn survives_every_degenerate_mesh() {
    for mesh in degenerate() {
        let (winding, mut queries) = (winding(&mesh), queries(&mesh, 100));
        // On corners, edges and faces too.
        queries.extend(&mesh.positions[..mesh.positions.len().min(200)]);
        for t in (0..mesh.triangles.len()).step_by(17) {
            let [a, b, c] = corners(&mesh, t);
            queries.extend([(a + b) / 2.0, (a + b + c) / 3.0].map(|x| x.as_vec3().to_array()));
        }
        let numbers = winding.numbers(&queries, &Progress::default()).unwrap();
        assert!(numbers.iter().all(|x| x.is_finite()), "{}", mesh.name);
    }
}

#[test]
fn inside_is_inside_whatever_the_mesh() {
    let ball = sphere(24, 16);
    let moved = |x: f64| ball.mapped(|p| p + DVec3::new(x, 0.0, 0.0));
    let mut punctured = ball.clone();
    punctured.triangles.truncate(ball.triangles.len() * 9 / 10);
    // Every triangle with corners of its own, as a seam on every edge leaves them.
    let split = ball.triangles.as_flattened().iter().map(|&i| ball.positions[i as usize]).collect::<Vec<_>>();
    let triangles = (0..ball.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let split = Fixture::new("split", split, triangles);
    let mut repeated = ball.clone();
    repeated.triangles.extend(ball.triangles.iter());
    let islands = moved(0.0).joined(moved(5.0)).named("two islands");
    for (mesh, inside, outside) in [
        (ball.clone(), [0.9, 0.0, 0.0], [1.1, 0.0, 0.0]),
        (moved(0.0).joined(moved(0.7)).named("overlapping"), [0.35, 0.0, 0.0], [1.9, 0.0, 0.0]),
        (islands, [5.5, 0.0, 0.0], [2.5, 0.0, 0.0]),
        (punctured.named("open"), [0.0, 0.0, 0.3], [0.0, 0.0, -1.5]),
        (split, [0.0, 0.9, 0.0], [0.0, 1.1, 0.0]),
        (repeated.named("repeated"), [0.0, 0.9, 0.0], [0.0, 1.1, 0.0]),
    ] {
        let answers = winding(&mesh).are_inside(&[inside, outside], &Progress::default()).unwrap();
        assert_eq!(answers, [true, false], "{}", mesh.name);
    }
}

#[test]
fn motion_and_scale_change_nothing() {
    let mesh = sphere(40, 30).joined(tube(20, 20));
    let (here, queries) = (winding(&mesh), queries(&mesh, 300));
    for scale in [1e-3, 1.0, 1e4] {
        let moved = |p: DVec3| rigid_motion(p) * scale;
        let there = winding(&mesh.mapped(moved));
        for &query in &queries {
            let there = there.number(moved(Vec3::from(query).as_dvec3()).as_vec3().to_array());
            assert!((here.number(query) - there).abs() < 2.0 * TOLERANCE, "scale {scale}");
        }
    }
}

#[test]
fn threads_change_no_bit() {
    let mesh = sphere(100, 60);
    let queries = queries(&mesh, 2000);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| winding(&mesh).numbers(&queries, &Progress::default()).unwrap())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn reports_progress_and_stops() {
    let mesh = sphere(24, 16);
    let (winding, queries, progress) = (winding(&mesh), queries(&mesh, 1000), Progress::default());
    winding.numbers(&queries, &progress).unwrap();
    assert!((progress.fraction() - 1.0).abs() < 1e-9);
    progress.cancel();
    assert_eq!(winding.numbers(&queries, &progress), Err(Error::Cancelled));
}
