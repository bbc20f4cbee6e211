//! Gradients by finite differences, single projections, kernels against their scalar twin.

mod holes;
mod sweeps;

use glam::Vec3;

use super::constraint::{Axis, HalfSpace, bind, energy, project_stretch, self_collision, stretch, volume};
use super::contact::Contact;
use super::pairs::{Slabs, Suspects, intersecting_pairs_of};
use super::projection::{
    Batch, Blocks, Colouring, Flesh, Kernel, Kind, Limits, Multipliers, OfNodes, Particle, Stretch, project,
};
use super::skin::Skin;

const CORNERS: [[f64; 3]; 4] = [[0.1, 0.2, -0.1], [1.3, 0.0, 0.2], [0.2, 0.9, 0.1], [-0.1, 0.3, 1.4]];

/// Central differences of `value` at each coordinate.
fn differences<const N: usize>(points: [[f64; 3]; N], value: impl Fn([[f64; 3]; N]) -> f64) -> [[f64; 3]; N] {
    let step = 1e-6;
    let mut gradient = [[0.0; 3]; N];
    for n in 0..N {
        for c in 0..3 {
            let (mut more, mut less) = (points, points);
            more[n][c] += step;
            less[n][c] -= step;
            gradient[n][c] = (value(more) - value(less)) / (2.0 * step);
        }
    }
    gradient
}

fn assert_close<const N: usize>(found: [[f64; 3]; N], expected: [[f64; 3]; N]) {
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        assert!((found - expected).abs() < 1e-6, "{found} against {expected}");
    }
}

#[test]
fn gradients_are_derivatives() {
    let ends = [CORNERS[0], CORNERS[1]];
    assert_close(stretch(ends, 0.7).gradient, differences(ends, |p| stretch(p, 0.7).value));
    assert_close(volume(CORNERS, 0.1).gradient, differences(CORNERS, |p| volume(p, 0.1).value));
    let arms = [0.5, 0.8, 0.6, 0.9];
    assert_close(energy(CORNERS, arms).gradient, differences(CORNERS, |p| energy(p, arms).value));
}

#[test]
fn edges_projected_with_one_division_move_as_value_and_gradient_say() {
    let (ends, w) = ([CORNERS[0], CORNERS[1]], [1.0, 0.5]);
    for (alpha, multiplier) in [(0.0, 0.0), (0.5, 0.0), (10.0, -0.2), (3.0, 0.7)] {
        let found = project_stretch(ends, w, 0.7, alpha, multiplier);
        let expected = stretch(ends, 0.7).project(w, alpha, multiplier);
        assert_close(found.moves, expected.moves);
        assert!((found.multiplier - expected.multiplier).abs() < 1e-9);
    }
    let coincide = [CORNERS[0]; 2];
    assert_eq!(project_stretch(coincide, w, 1.0, 0.0, 0.0).moves, [[0.0; 3]; 2]);
}

#[test]
fn one_hard_projection_solves_a_single_stretch_and_soft_ones_settle_at_their_compliance() {
    let ends: [[f64; 3]; 2] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    let hard = stretch(ends, 1.0).project([1.0, 1.0], 0.0, 0.0);
    assert!((hard.moves[0][0] - 0.5).abs() < 1e-9 && (hard.moves[1][0] + 0.5).abs() < 1e-9);
    // min |x - x0|^2 / 2 + C^2 / (2 alpha) leaves C = alpha C0 / (alpha + 2).
    let (mut points, mut multiplier) = (ends, 0.0);
    for _ in 0..50 {
        let step = stretch(points, 1.0).project([1.0, 1.0], 3.0, multiplier);
        multiplier += step.multiplier;
        for (point, by) in points.iter_mut().zip(step.moves) {
            (0..3).for_each(|c| point[c] += by[c]);
        }
    }
    assert!((stretch(points, 1.0).value - 3.0 / 5.0).abs() < 1e-6);
}

#[test]
fn bind_is_one_sided_and_planes_leave_their_own_side_alone() {
    let axis = Axis { origin: Vec3::ZERO, directions: [-Vec3::X, Vec3::X] };
    assert_eq!(bind(&axis, Vec3::new(0.3, 0.9, 0.0), 0.0, 1.0), Vec3::ZERO);
    let back = bind(&axis, Vec3::new(0.3, 2.0, 0.0), 0.0, 1.0);
    assert!((back - Vec3::new(0.0, -1.0, 0.0)).length() < 1e-6);
    let plane = HalfSpace { origin: Vec3::ZERO, normal: Vec3::X, gap: 0.1 };
    assert_eq!(self_collision(&plane, Vec3::new(0.2, 5.0, 0.0), plane.heights(1.0)), Vec3::ZERO);
    assert!(
        (self_collision(&plane, Vec3::new(0.2, 5.0, 0.0), plane.heights(-1.0)) - Vec3::new(-0.3, 0.0, 0.0)).length()
            < 1e-6
    );
}

/// One particle under limits.
fn limited<const M: usize, K: Kind<1, M, 0>>(kind: K, at: Vec3, rest: [f32; M]) -> Vec3 {
    let mut particles = [[at.x, at.y, at.z, 1.0]];
    let batch = Batch::new(Blocks::new(0, 1), &Colouring::single(1), &[0], |_| [0], |_| rest);
    project(Kernel::Lanes, kind, &batch, &mut Multipliers::new(0), &mut particles);
    Vec3::new(particles[0][0], particles[0][1], particles[0][2])
}

#[test]
fn limits_of_eight_lanes_are_bind_and_plane_one_after_the_other() {
    let axis = Axis { origin: Vec3::new(0.1, -0.2, 0.0), directions: [-Vec3::X, Vec3::new(0.6, 0.8, 0.0)] };
    let plane = HalfSpace { origin: axis.origin, normal: Vec3::new(0.8, 0.6, 0.0), gap: 0.05 };
    let (most, limits) = (1.1, Limits::new(&axis, Some(&plane), 1.1));
    let (free, plane_alone) = (Limits::new(&axis, None, 0.0), Limits::new(&axis, Some(&plane), 0.0));
    for k in 0..200u32 {
        let at = Vec3::new(noise(3 * k), noise(3 * k + 1), noise(3 * k + 2)) * 4.0;
        for side in [1.0, -1.0, 0.0] {
            let distance = 0.2 + noise(k).abs();
            let bound = at + bind(&axis, at, 0.0, most * distance);
            let expected = bound + self_collision(&plane, bound, plane.heights(side));
            assert!(limited(limits, at, [distance, side]).distance(expected) < 1e-5);
            assert!(limited(free, at, [distance, side]).distance(at) < 1e-6);
            let node = if side == 0.0 { at } else { at + self_collision(&plane, at, plane.heights(side)) };
            assert!(limited(OfNodes(plane_alone), at, [side]).distance(node) < 1e-5);
        }
    }
}

#[test]
fn slabs_and_cleared_triangles_change_no_pair() {
    let count = 900u32;
    let corner = |k: u32| Vec3::new(noise(5 * k), noise(5 * k + 1), noise(5 * k + 2));
    let small = |k: u32| corner(k / 3) * 2.0 + corner(k + 7000) * 0.3;
    let places: Vec<Vec3> = (0..3 * count).map(small).collect();
    let triangles: Vec<[u32; 3]> = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let all: Vec<u32> = (0..count).collect();
    let normals = [Vec3::new(0.6, 0.8, 0.0), Vec3::new(0.0, 0.6, -0.8), Vec3::new(0.0, 0.28, 0.96)];
    let slanting = Slabs::new(normals);
    let find = |cleared: &(dyn Fn(u32) -> bool + Sync), slabs: &Slabs| {
        let among = Suspects { cleared, ..Suspects::all_of(&all) };
        intersecting_pairs_of(&places, &triangles, among, slabs)
    };
    let plain = find(&|_| false, &Slabs::new([]));
    assert!(plain.len() > 100);
    assert_eq!(find(&|_| false, &slanting), plain);
    let cleared = |t: u32| !t.is_multiple_of(3);
    let fresh: Vec<_> = plain.iter().copied().filter(|pair| !pair.iter().all(|&t| cleared(t))).collect();
    assert_eq!(find(&cleared, &slanting), fresh);
    assert!(fresh.len() < plain.len());
}

/// Loose triangles in three pieces.
struct Loose(Vec<[u32; 3]>);

impl Skin for Loose {
    fn triangles(&self) -> &[[u32; 3]] {
        &self.0
    }

    fn name(&self, triangle: u32) -> u32 {
        triangle
    }

    fn ring(&self, _vertex: u32) -> &[u32] {
        &[]
    }

    fn is_free(&self, _vertex: u32) -> bool {
        true
    }

    fn island(&self, triangle: u32) -> u32 {
        triangle % 3
    }
}

#[test]
fn pairs_looked_for_again_are_those_of_a_fresh_search() {
    let count = 900u32;
    let corner = |k: u32| Vec3::new(noise(5 * k), noise(5 * k + 1), noise(5 * k + 2));
    let mut places: Vec<Vec3> = (0..3 * count).map(|k| corner(k / 3) * 2.0 + corner(k + 7000) * 0.3).collect();
    let skin = Loose((0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect());
    let (all, slabs, contact): (Vec<u32>, _, _) = ((0..count).collect(), Slabs::new([]), Contact::default());
    let mut pairs = contact.own_pairs(&skin, &places, Suspects::all_of(&all), &slabs);
    let any_piece = intersecting_pairs_of(&places, &skin.0, Suspects::all_of(&all), &slabs);
    let of_one_piece = |pair: &[u32; 2]| pair[0] % 3 == pair[1] % 3;
    assert_eq!(pairs, any_piece.into_iter().filter(of_one_piece).collect::<Vec<_>>());
    for round in 0..4 {
        let moved: Vec<u32> = (0..3 * count).filter(|i| (i / 7 + round) % 5 == 0).collect();
        moved.iter().for_each(|&i| places[i as usize] += corner(i + 99 * round) * 0.2);
        let fresh = contact.own_pairs(&skin, &places, Suspects::all_of(&all), &slabs);
        assert!(fresh.len() > 30 && fresh != pairs);
        pairs = contact.all_own_pairs_again(&skin, &places, (pairs, &moved), &slabs);
        assert_eq!(pairs, fresh);
    }
}

/// Deterministic numbers from -0.5 to 0.5.
fn noise(seed: u32) -> f32 {
    let mut x = seed.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    x ^= x >> 15;
    x = x.wrapping_mul(0x2c1b_3c6d);
    x ^= x >> 12;
    (x >> 8) as f32 / (1u32 << 24) as f32 - 0.5
}

#[test]
fn lanes_on_any_number_of_threads_have_the_bits_of_the_scalar_twin() {
    let count = 3000u32;
    let particles: Vec<Particle> =
        (0..count).map(|i| [noise(3 * i), noise(3 * i + 1), noise(3 * i + 2), (i % 7 != 0) as u8 as f32]).collect();
    let corner = |k: u32, n: u32| (k * 37 + n * 811 + k * k % 97) % count;
    let fours: Vec<[u32; 4]> = (0..5000).map(|k| [0, 1, 2, 3].map(|n| corner(k, n))).collect();
    let twos: Vec<[u32; 2]> = (0..5000).map(|k| [corner(k, 0), corner(k, 1)]).collect();
    let blocks = Blocks::new(0, count as usize);
    let (of_fours, of_twos) = (Colouring::new(&fours, count as usize), Colouring::new(&twos, count as usize));
    let all: Vec<u32> = (0..5000).collect();
    let run = |kernel, threads: usize| {
        let mut particles = particles.clone();
        let edges = Batch::new(blocks, &of_twos, &all, |k| twos[k as usize], |_| [0.3]);
        let tetrahedra = Batch::new(blocks, &of_fours, &all, |k| fours[k as usize], |_| []);
        let mut multipliers = (Multipliers::new(edges.len()), Multipliers::new(tetrahedra.len()));
        let flesh = Flesh { volume: 0.02, arm: 0.3, volume_compliance: Some(0.0005), energy_compliance: Some(2.0) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            for _ in 0..3 {
                project(kernel, Stretch(1.0), &edges, &mut multipliers.0, &mut particles);
                project(kernel, flesh, &tetrahedra, &mut multipliers.1, &mut particles);
            }
        });
        particles.into_flattened().into_iter().map(f32::to_bits).collect::<Vec<_>>()
    };
    let twin = run(Kernel::Scalar, 1);
    assert_ne!(twin, particles.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    for threads in [1, 2, 5] {
        assert_eq!(run(Kernel::Lanes, threads), twin);
    }
}
