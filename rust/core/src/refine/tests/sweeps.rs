//! Ten sweeps over all constraints of a block at the size of the paper (51,840 tetrahedra, 234,312 constraints), on one
//! thread and two, beside a serial Gauss-Seidel of the same constraints, run in turns. Medians of wall time.
//!
//!     cargo test --release -p skinwright-core --lib sweeps -- --ignored --nocapture

use std::time::Instant;

use rayon::ThreadPoolBuilder;

use super::super::constraint::{Constraint, energy, stretch, volume};
use super::super::projection::{Batch, Blocks, Colouring, Flesh, Kernel, Multipliers, Particle, Stretch, project};

const RUNS: usize = 15;
const SWEEPS: usize = 10;

/// Milliseconds of wall time.
#[derive(Default)]
struct Times(Vec<f64>);

impl Times {
    fn run(&mut self, work: impl FnOnce()) {
        let start = Instant::now();
        work();
        self.0.push(start.elapsed().as_secs_f64() * 1e3);
    }

    fn median(mut self) -> f64 {
        self.0.sort_by(f64::total_cmp);
        self.0[self.0.len() / 2]
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

#[test]
#[ignore = "measures time"]
fn sweeps() {
    let pools = [1, 2].map(|threads| ThreadPoolBuilder::new().num_threads(threads).build().unwrap());
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
        for (times, pool) in times[1..].iter_mut().zip(&pools) {
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
    let [serial, one, two] = times.map(Times::median);
    let each = |ms: f64| ms * 1e6 / (constraints * SWEEPS) as f64;
    println!("{SWEEPS} sweeps over {constraints} constraints ({} tetrahedra):", tetrahedra.len());
    for (name, ms) in [("serial Gauss-Seidel", serial), ("1 thread", one), ("2 threads", two)] {
        println!("  {name}: {ms:.1} ms ({:.1} ns each), {:.2} x", each(ms), serial / ms);
    }
}
