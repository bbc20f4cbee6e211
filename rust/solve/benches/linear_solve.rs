//! Ordering, factoring and solving for 60 bones on a folded, irregularly triangulated tube: one component, two-ring couplings.

use divan::{Bencher, counter::ItemsCount};
use glam::Vec3;
use skinwright_solve::{Cholesky, Method, RightHandSides, SymmetricMatrix};

fn main() {
    divan::main();
}

/// Vertices of the tube. A million fits in memory too, but takes its time.
const SIZES: [usize; 4] = [5_000, 20_000, 100_000, 300_000];
const BONES: usize = 60;

/// Neighbours of each vertex on a tube of `around` by `along` vertices, each cell cut along a random diagonal.
fn neighbours(around: usize, along: usize) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); around * along];
    let mut state = 1u64;
    let mut join = |i: usize, j: usize| {
        neighbours[i].push(j);
        neighbours[j].push(i);
    };
    for y in 0..along {
        for x in 0..around {
            let (here, right) = (y * around + x, y * around + (x + 1) % around);
            join(here, right);
            if y + 1 < along {
                join(here, here + around);
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                if state >> 63 == 0 { join(here, right + around) } else { join(right, here + around) }
            }
        }
    }
    neighbours
}

/// (I + 100 L)^2 with L the graph Laplacian.
fn matrix(neighbours: &[Vec<usize>]) -> SymmetricMatrix {
    let row = |i: usize| {
        let own = std::iter::once((i, 1.0 + 100.0 * neighbours[i].len() as f64));
        own.chain(neighbours[i].iter().map(|&j| (j, -100.0)))
    };
    let mut matrix = SymmetricMatrix { column_starts: vec![0], ..Default::default() };
    for i in 0..neighbours.len() {
        let products = row(i).flat_map(|(k, a)| row(k).map(move |(j, b)| (j as u32, a * b)));
        let mut column: Vec<(u32, f64)> = products.filter(|&(j, _)| j as usize >= i).collect();
        column.sort_by_key(|&(j, _)| j);
        for (j, value) in column {
            if matrix.rows.len() > matrix.column_starts[i] && matrix.rows.last() == Some(&j) {
                *matrix.values.last_mut().expect("as long as the rows") += value;
            } else {
                matrix.rows.push(j);
                matrix.values.push(value);
            }
        }
        matrix.column_starts.push(matrix.rows.len());
    }
    matrix
}

fn tube(size: usize) -> (SymmetricMatrix, Vec<Vec3>) {
    let around = (3.0 * size as f64).sqrt() as usize;
    let position = |i: usize| {
        let (angle, height) = ((i % around) as f32 / around as f32 * std::f32::consts::TAU, (i / around) as f32);
        let radius = 0.3 + 0.05 * (11.0 * angle).sin();
        Vec3::new(radius * angle.cos(), height * 1.9 / around as f32, radius * angle.sin())
    };
    let along = size / around;
    (matrix(&neighbours(around, along)), (0..around * along).map(position).collect())
}

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn order(bencher: Bencher, size: usize) {
    let (matrix, positions) = tube(size);
    bencher.counter(ItemsCount::new(size)).bench(|| Cholesky::count_flops(&matrix, &positions));
}

#[divan::bench(args = SIZES, consts = [0, 1], sample_count = 5, sample_size = 1)]
fn order_and_factor<const METHOD: usize>(bencher: Bencher, size: usize) {
    let (matrix, positions) = tube(size);
    let method = Method::ALL[METHOD];
    bencher
        .counter(ItemsCount::new(size))
        .with_inputs(|| matrix.clone())
        .bench_values(|matrix| Cholesky::factor_with(method, matrix, &positions));
}

#[divan::bench(args = SIZES, consts = [0, 1], sample_count = 5, sample_size = 1)]
fn solve<const METHOD: usize>(bencher: Bencher, size: usize) {
    let (matrix, positions) = tube(size);
    let n = matrix.size();
    let factor = Cholesky::factor_with(Method::ALL[METHOD], matrix, &positions).expect("positive definite");
    let rhs = right_hand_sides(n, BONES);
    bencher.counter(ItemsCount::new(size)).bench(|| factor.solve(&rhs));
}

fn right_hand_sides(n: usize, columns: usize) -> RightHandSides {
    RightHandSides::dense(n, columns, (0..n * columns).map(|i| (i as f64).sin()).collect())
}

/// A wardrobe: many small components, one after the other.
#[divan::bench(args = [10, 100, 1000], consts = [0, 1], sample_count = 5, sample_size = 1)]
fn hundred_small_blocks<const METHOD: usize>(bencher: Bencher, size: usize) {
    let (matrix, positions) = tube(size);
    let rhs = right_hand_sides(matrix.size(), 12);
    bencher.counter(ItemsCount::new(100 * size)).with_inputs(|| vec![matrix.clone(); 100]).bench_values(|matrices| {
        for matrix in matrices {
            let factor = Cholesky::factor_with(Method::ALL[METHOD], matrix, &positions).expect("positive definite");
            factor.solve(&rhs);
        }
    });
}
