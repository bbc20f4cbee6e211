//! The simplex solver alone (one thread, time of 100,000 problems) and whole strokes of 2,000 vertices.

use divan::Bencher;
use glam::{DAffine3, DVec3};
use skinwright_core::Weights;
use skinwright_core::sculpt::{Options, SculptSolver, SimplexQp};

fn main() {
    divan::main();
}

const PROBLEMS: usize = 100_000;

/// Uniform in -1..1, always the same.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

fn problem<const N: usize>(random: &mut Random) -> (SimplexQp<N>, [f64; N]) {
    const PULL: f64 = 0.05 * 0.05;
    let e: [DVec3; N] = std::array::from_fn(|_| random.point());
    let mut start = [0.0; N];
    start[0] = 0.6;
    start[1] = 0.4;
    let h = std::array::from_fn(|i| std::array::from_fn(|j| e[i].dot(e[j]) + if i == j { PULL } else { 0.0 }));
    (SimplexQp { h, g: start.map(|o| PULL * o), n: N, mass: 1.0 }, start)
}

#[divan::bench(consts = [4, 12], sample_count = 20)]
fn qp_100k<const N: usize>(bencher: Bencher) {
    let mut random = Random(88_172_645_463_325_252);
    let problems: Vec<_> = (0..PROBLEMS).map(|_| problem::<N>(&mut random)).collect();
    bencher.bench_local(|| {
        problems.iter().fold(0.0, |sum, (qp, start)| {
            let mut w = *start;
            qp.minimise(&mut w);
            sum + w[0]
        })
    });
}

#[divan::bench(args = [1, 8], sample_count = 20)]
fn stroke_2000(bencher: Bencher, poses: usize) {
    let mut random = Random(88_172_645_463_325_252);
    let touched: Vec<u32> = (0..2000).map(|i| 50 * i).collect();
    let solver = sculpted(&mut random, &touched, poses);
    let targets: Vec<[f32; 3]> = touched.iter().map(|_| random.point().as_vec3().to_array()).collect();
    bencher.with_inputs(|| solver.clone()).bench_refs(|solver| solver.stroke(0, &touched, &targets).unwrap());
}

/// 100,000 vertices, four members each of 163 bones, `touched` sculpted in so many poses.
fn sculpted(random: &mut Random, touched: &[u32], poses: usize) -> SculptSolver {
    let count = 100_000u32;
    let rest: Vec<[f32; 3]> = (0..count).map(|_| random.point().as_vec3().to_array()).collect();
    let bones = (0..count).flat_map(|i| (0..4).map(move |j| (i / 700 + j) % 163)).collect();
    let weights =
        Weights::new((0..=count).map(|i| 4 * i).collect(), bones, vec![0.25; 4 * count as usize], 163).unwrap();
    let mut solver = SculptSolver::new(&rest, weights, &[], Options::default()).unwrap();
    for _ in 0..poses {
        let pose = (0..163).map(|_| DAffine3::from_axis_angle(random.point().normalize(), random.next())).collect();
        let pose = solver.add_pose(pose, 1.0).unwrap();
        let targets: Vec<[f32; 3]> = touched.iter().map(|_| random.point().as_vec3().to_array()).collect();
        solver.stroke(pose, touched, &targets).unwrap();
    }
    solver
}
