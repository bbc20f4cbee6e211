//! Refinement at the size of the paper (24,000 vertices, 51,000 tetrahedra, 230,000 constraints, all of them active):
//! whole frames on one and two threads. Medians of wall time and of CPU time of all threads, and the stages of a frame. The
//! constraints alone, beside a serial Gauss-Seidel, are in `src/refine/tests/sweeps.rs`.
//!
//!     cargo bench -p skinwright-core --bench refine

use std::time::Instant;

use glam::{DAffine3, DMat3};
use rayon::{ThreadPool, ThreadPoolBuilder};
use skinwright_core::refine::{Kernel, Quality, Refiner, Settings};
use skinwright_core::{Progress, TriMesh, Weights};

const RUNS: usize = 15;

fn main() {
    let pools = [1, 2].map(|threads| ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    frames(&pools);
}

/// Median milliseconds of wall time and of CPU time.
#[derive(Default)]
struct Times(Vec<[f64; 2]>);

impl Times {
    fn run<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (start, cpu) = (Instant::now(), cpu_seconds());
        let result = work();
        self.0.push([start.elapsed().as_secs_f64() * 1e3, (cpu_seconds() - cpu) * 1e3]);
        result
    }

    fn medians(&self) -> [f64; 2] {
        [0, 1].map(|k| {
            let mut times: Vec<f64> = self.0.iter().map(|time| time[k]).collect();
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        })
    }
}

/// Of all threads of this process, where the system tells (Linux).
fn cpu_seconds() -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let of_task = |task: std::fs::DirEntry| {
        let line = std::fs::read_to_string(task.path().join("schedstat")).unwrap_or_default();
        line.split(' ').next().and_then(|first| first.parse::<f64>().ok()).unwrap_or(0.0)
    };
    tasks.flatten().map(of_task).sum::<f64>() * 1e-9
}

/// A capped tube of radius 0.25 along x; weights change sides smoothly within 0.25 of the middle.
fn limb(around: usize, along: usize, half: f32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>, Weights) {
    let mut positions = Vec::new();
    for i in 0..=along {
        for j in 0..around {
            let angle = std::f32::consts::TAU * j as f32 / around as f32;
            positions.push([half * (2.0 * i as f32 / along as f32 - 1.0), 0.25 * angle.cos(), 0.25 * angle.sin()]);
        }
    }
    let ends = [positions.len() as u32, positions.len() as u32 + 1];
    positions.extend([[-half, 0.0, 0.0], [half, 0.0, 0.0]]);
    let at = |i: usize, j: usize| (i * around + j % around) as u32;
    let mut triangles = Vec::new();
    for j in 0..around {
        for i in 0..along {
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
            triangles.extend(if (i + j) % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] });
        }
        triangles.extend([[ends[0], at(0, j + 1), at(0, j)], [ends[1], at(along, j), at(along, j + 1)]]);
    }
    let share = |p: &[f32; 3]| {
        let t = ((p[0] + 0.25) / 0.5).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let values = positions.iter().map(share).flat_map(|t| [1.0 - t, t]).collect();
    let indptr = (0..=positions.len() as u32).map(|i| 2 * i).collect();
    let weights = Weights::new(indptr, [0, 1].repeat(positions.len()), values, 2).unwrap();
    (positions, triangles, weights)
}

fn bent(degrees: f64) -> [DAffine3; 2] {
    [DAffine3::IDENTITY, DAffine3::from_mat3(DMat3::from_rotation_z(degrees.to_radians()))]
}

/// Every run bends by another angle: regions are kept for a while, as they are while an animation plays.
fn frames(pools: &[ThreadPool; 2]) {
    let half = 0.72;
    let (positions, triangles, weights) = limb(128, 190, half);
    let segments = [[[-f64::from(half), 0.0, 0.0], [0.0; 3]], [[0.0; 3], [f64::from(half), 0.0, 0.0]]];
    let settings = Settings { cell: Some(0.0410), ..Settings::default() };
    let mesh = TriMesh::new(&positions, &triangles, "limb").unwrap();
    let start = Instant::now();
    let refiner = Refiner::new(&mesh, &weights, &[-1, 0], &segments, settings, &Progress::default()).unwrap();
    println!("\nprepared in {:.0} ms; {} vertices", start.elapsed().as_secs_f64() * 1e3, positions.len());
    for quality in Quality::ALL {
        let (_, report) = refiner.solve_with_report(&bent(120.0), quality, Kernel::Lanes).unwrap();
        let (tetrahedra, constraints) = (report.active_tetrahedra, report.constraints);
        println!(
            "{}: {tetrahedra} tetrahedra ({} inverted), {constraints} constraints, {} iterations, {} pairs left",
            quality.name(),
            report.inverted_tetrahedra,
            report.iterations,
            report.pairs_after,
        );
        let mut times: [Times; 2] = Default::default();
        for run in 0..RUNS {
            let pose = bent(118.0 + 0.2 * run as f64);
            for (times, pool) in times.iter_mut().zip(pools) {
                times.run(|| pool.install(|| refiner.solve(&pose, quality).unwrap()));
            }
        }
        let [one, two] = times.map(|times| times.medians());
        println!(
            "  1 thread {:.1} ms wall, {:.1} CPU; 2 threads {:.1} wall, {:.1} CPU",
            one[0], one[1], two[0], two[1]
        );
        let stages: Vec<String> = pools[0].install(|| {
            let (_, report) = refiner.solve_with_report(&bent(119.0), quality, Kernel::Lanes).unwrap();
            report.stages.iter().map(|(name, ms)| format!("{name} {ms:.1}")).collect()
        });
        println!("  stages on 1 thread: {}", stages.join(", "));
    }
}
