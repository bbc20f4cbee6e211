//! Refinement at the size of the paper (24,000 vertices, 51,000 tetrahedra, 230,000 constraints, all of them active):
//! whole frames on one and two threads, and ten sweeps over all constraints beside a serial Gauss-Seidel of the same
//! constraints, run in turns. Medians of wall time and of CPU time of all threads, and the stages of a frame.
//!
//!     cargo bench -p skinwright-core --bench refine

use std::time::Instant;

use glam::{DAffine3, DMat3};
use rayon::{ThreadPool, ThreadPoolBuilder};
use skinwright_core::refine::constraint::{Constraint, energy, stretch, volume};
use skinwright_core::refine::projection::{
    Batch, Blocks, Colouring, Flesh, Kernel, Multipliers, Particle, Stretch, project,
};
use skinwright_core::refine::{Quality, Refiner, Settings};
use skinwright_core::{Progress, TriMesh, Weights};

const RUNS: usize = 15;
const SWEEPS: usize = 10;

fn main() {
    let pools = [1, 2].map(|threads| ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
    sweeps(&pools);
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

/// A block of cubes of six tetrahedra each, its edges, and a surface's worth of edges.
struct Block {
    particles: Vec<Particle>,
    edges: Vec<[u32; 2]>,
    tetrahedra: Vec<[u32; 4]>,
    lengths: Vec<f32>,
}

const VOLUME: f32 = 1.0 / 6.0;

fn block([x, y, z]: [u32; 3]) -> Block {
    let at = |i: u32, j: u32, k: u32| (i * (y + 1) + j) * (z + 1) + k;
    let mut places = Vec::new();
    for i in 0..=x {
        for j in 0..=y {
            places.extend((0..=z).map(|k| [i as f32, j as f32, k as f32]));
        }
    }
    let mut tetrahedra = Vec::new();
    for (i, j, k) in (0..x).flat_map(|i| (0..y).flat_map(move |j| (0..z).map(move |k| (i, j, k)))) {
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut corner = [i, j, k];
            let mut corners = [at(i, j, k); 4];
            for (n, axis) in order.into_iter().enumerate() {
                corner[axis] += 1;
                corners[n + 1] = at(corner[0], corner[1], corner[2]);
            }
            if [[0, 2, 1], [2, 1, 0], [1, 0, 2]].contains(&order) {
                corners.swap(2, 3);
            }
            tetrahedra.push(corners);
        }
    }
    let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let mut edges: Vec<[u32; 2]> =
        tetrahedra.iter().flat_map(|t| pairs.map(|[a, b]| [t[a].min(t[b]), t[a].max(t[b])])).collect();
    edges.sort_unstable();
    edges.dedup();
    let surface = edges.clone();
    edges.extend(surface);
    let distance = |[a, b]: [u32; 2]| {
        let [a, b] = [places[a as usize], places[b as usize]];
        (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum::<f32>().sqrt()
    };
    let lengths = edges.iter().map(|&edge| distance(edge)).collect();
    // Sheared and twisted, so that every constraint has something to do.
    let moved = |&[a, b, c]: &[f32; 3]| [a + 0.2 * b, b * (1.0 + 0.004 * a) + 0.01 * a, c + 0.05 * a, 1.0];
    Block { particles: places.iter().map(moved).collect(), edges, tetrahedra, lengths }
}

fn flesh() -> Flesh {
    Flesh { volume: VOLUME, arm: 0.6, volume_compliance: Some(0.0), energy_compliance: Some(10.0) }
}

/// One constraint after the other in the mesh's order, each with its own record: what there is without batches.
struct Serial {
    edges: Vec<([u32; 2], f32, f32)>,
    tetrahedra: Vec<([u32; 4], [f32; 2])>,
}

impl Serial {
    fn new(block: &Block) -> Self {
        let edges = block.edges.iter().zip(&block.lengths).map(|(&edge, &length)| (edge, length, 0.0)).collect();
        Self { edges, tetrahedra: block.tetrahedra.iter().map(|&t| (t, [0.0; 2])).collect() }
    }

    fn sweep(&mut self, particles: &mut [Particle]) {
        for (ends, length, multiplier) in &mut self.edges {
            apply(stretch(ends.map(|p| place(particles, p)), *length), *ends, 1.0, multiplier, particles);
        }
        for (corners, [first, second]) in &mut self.tetrahedra {
            apply(volume(corners.map(|p| place(particles, p)), VOLUME), *corners, 0.0, first, particles);
            apply(energy(corners.map(|p| place(particles, p)), [0.6; 4]), *corners, 10.0, second, particles);
        }
    }
}

fn place(particles: &[Particle], p: u32) -> [f32; 3] {
    let [x, y, z, _] = particles[p as usize];
    [x, y, z]
}

fn apply<const N: usize>(
    constraint: Constraint<f32, N>,
    points: [u32; N],
    compliance: f32,
    multiplier: &mut f32,
    particles: &mut [Particle],
) {
    let step = constraint.project(points.map(|p| particles[p as usize][3]), compliance, *multiplier);
    *multiplier += step.multiplier;
    for (p, by) in points.into_iter().zip(step.moves) {
        (0..3).for_each(|c| particles[p as usize][c] += by[c]);
    }
}

fn sweeps(pools: &[ThreadPool; 2]) {
    let block = block([60, 12, 12]);
    let count = block.particles.len();
    let blocks = Blocks::new(0, count);
    let (of_edges, of_tetrahedra) = (Colouring::new(&block.edges, count), Colouring::new(&block.tetrahedra, count));
    let all = |n: usize| (0..n as u32).collect::<Vec<_>>();
    let edges = Batch::new(
        blocks,
        &of_edges,
        &all(block.edges.len()),
        |k| block.edges[k as usize],
        |k| [block.lengths[k as usize]],
    );
    let tetrahedra =
        Batch::new(blocks, &of_tetrahedra, &all(block.tetrahedra.len()), |k| block.tetrahedra[k as usize], |_| []);
    let mut multipliers = (Multipliers::<1>::new(edges.len()), Multipliers::<2>::new(tetrahedra.len()));
    let constraints = edges.len() + 2 * tetrahedra.len();
    let mut serial = Serial::new(&block);
    let mut times: [Times; 3] = Default::default();
    for _ in 0..RUNS {
        let mut particles = block.particles.clone();
        serial.edges.iter_mut().for_each(|edge| edge.2 = 0.0);
        serial.tetrahedra.iter_mut().for_each(|t| t.1 = [0.0; 2]);
        times[0].run(|| (0..SWEEPS).for_each(|_| serial.sweep(&mut particles)));
        assert!(particles.as_flattened().iter().all(|x| x.is_finite()));
        for (times, pool) in times[1..].iter_mut().zip(pools) {
            let mut particles = block.particles.clone();
            multipliers.0.restart();
            multipliers.1.restart();
            let sweep = |_| {
                project(Kernel::Lanes, Stretch(1.0), &edges, &mut multipliers.0, &mut particles);
                project(Kernel::Lanes, flesh(), &tetrahedra, &mut multipliers.1, &mut particles);
            };
            times.run(|| pool.install(|| (0..SWEEPS).for_each(sweep)));
            assert!(particles.as_flattened().iter().all(|x| x.is_finite()));
        }
    }
    let [serial, one, two] = times.map(|times| times.medians());
    let each = |ms: f64| ms * 1e6 / (constraints * SWEEPS) as f64;
    println!("{SWEEPS} sweeps over {constraints} constraints ({} tetrahedra):", tetrahedra.len());
    println!("  serial Gauss-Seidel {:.1} ms wall ({:.1} ns each)", serial[0], each(serial[1]));
    println!("  1 thread {:.1} ms wall ({:.1} ns of CPU each), {:.2} x", one[0], each(one[1]), serial[0] / one[0]);
    println!("  2 threads {:.1} ms wall ({:.1} ns of CPU each), {:.2} x", two[0], each(two[1]), serial[0] / two[0]);
}
