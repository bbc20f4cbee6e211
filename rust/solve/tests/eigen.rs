//! Truncated eigenpairs against faer's dense decomposition and against the equation itself.

use faer::{Mat, Side};
use glam::Vec3;
use skinwright_solve::SymmetricMatrix;
use skinwright_solve::eigen::{NoEigenpairs, smallest_eigenpairs};

/// The graph Laplacian of a grid with jittered edge weights, closed to a torus if asked, and masses between 1 and 2.
fn grid(width: usize, height: usize, torus: bool) -> (SymmetricMatrix, Vec<f64>, Vec<Vec3>) {
    let n = width * height;
    let mut columns = vec![std::collections::BTreeMap::<u32, f64>::new(); n];
    let mut join = |a: usize, b: usize, weight: f64| {
        *columns[a].entry(a as u32).or_default() += weight;
        *columns[b].entry(b as u32).or_default() += weight;
        *columns[a.min(b)].entry(a.max(b) as u32).or_default() -= weight;
    };
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let weight = |k: usize| if torus { 1.0 } else { 1.0 + 0.5 * ((x * 7 + y * 13 + k) as f64).sin() };
        if x + 1 < width || torus {
            join(y * width + x, y * width + (x + 1) % width, weight(0));
        }
        if y + 1 < height || torus {
            join(y * width + x, (y + 1) % height * width + x, weight(1));
        }
    }
    let mut matrix = SymmetricMatrix { column_starts: vec![0], ..Default::default() };
    for column in columns {
        matrix.rows.extend(column.keys());
        matrix.values.extend(column.values());
        matrix.column_starts.push(matrix.rows.len());
    }
    let mass = (0..n).map(|i| if torus { 1.0 } else { 1.5 + 0.5 * (i as f64).cos() }).collect();
    let positions = (0..n).map(|i| Vec3::new((i % width) as f32, (i / width) as f32, 0.0)).collect();
    (matrix, mass, positions)
}

fn full(matrix: &SymmetricMatrix) -> Mat<f64> {
    let mut full = Mat::zeros(matrix.size(), matrix.size());
    for j in 0..matrix.size() {
        for at in matrix.column_starts[j]..matrix.column_starts[j + 1] {
            let i = matrix.rows[at] as usize;
            full[(i, j)] = matrix.values[at];
            full[(j, i)] = matrix.values[at];
        }
    }
    full
}

/// Eigenvalues against the dense ones, `S X = M X Lambda`, `X' M X = 1`.
fn check(matrix: &SymmetricMatrix, mass: &[f64], positions: &[Vec3], count: usize) {
    let pairs = smallest_eigenpairs(matrix, mass, positions, count, &|_| true).unwrap();
    let (n, s) = (mass.len(), full(matrix));
    let scaled = Mat::from_fn(n, n, |i, j| s[(i, j)] / (mass[i] * mass[j]).sqrt());
    let wanted = scaled.self_adjoint_eigen(Side::Lower).unwrap();
    // The first eigenvalue is zero and gives no scale.
    let scale = wanted.S()[(count - 1).clamp(1, n - 1)];
    for (k, &value) in pairs.values.iter().enumerate() {
        assert!((value - wanted.S()[k]).abs() <= 1e-9 * scale, "{k}: {value} {}", wanted.S()[k]);
    }
    let x = Mat::from_fn(n, count, |i, k| pairs.vectors[i * count + k]);
    let mx = Mat::from_fn(n, count, |i, k| mass[i] * x[(i, k)]);
    let residual = &s * &x - Mat::from_fn(n, count, |i, k| mx[(i, k)] * pairs.values[k]);
    assert!(residual.norm_max() < 1e-7 * scale, "residual {}", residual.norm_max());
    let off = x.transpose() * mx - Mat::<f64>::identity(count, count);
    assert!(off.norm_max() < 1e-10, "orthonormal to {}", off.norm_max());
}

#[test]
fn agrees_with_a_dense_decomposition() {
    let (matrix, mass, positions) = grid(40, 25, false);
    for count in [1, 8, 60] {
        check(&matrix, &mass, &positions, count);
    }
}

#[test]
fn finds_multiple_eigenvalues() {
    // A square torus has eigenvalues of multiplicity four and eight.
    let (matrix, mass, positions) = grid(28, 28, true);
    check(&matrix, &mass, &positions, 60);
}

#[test]
fn small_problems_and_all_pairs() {
    let (matrix, mass, positions) = grid(7, 5, false);
    for count in [1, 10, 35] {
        check(&matrix, &mass, &positions, count);
    }
    assert_eq!(smallest_eigenpairs(&matrix, &mass, &positions, 99, &|_| true).unwrap().values.len(), 35);
}

#[test]
fn finds_one_null_vector_per_component() {
    let (one, mass, positions) = grid(25, 20, false);
    let n = one.size();
    let mut two = one.clone();
    two.column_starts.extend(one.column_starts[1..].iter().map(|end| end + one.rows.len()));
    two.rows.extend(one.rows.iter().map(|row| row + n as u32));
    two.values.extend(&one.values);
    let mass = [mass.clone(), mass].concat();
    let positions: Vec<Vec3> =
        positions.iter().copied().chain(positions.iter().map(|p| *p + Vec3::new(100.0, 0.0, 0.0))).collect();
    let pairs = smallest_eigenpairs(&two, &mass, &positions, 6, &|_| true).unwrap();
    assert!(pairs.values[1] < 1e-12 && pairs.values[2] > 1e-3, "{:?}", pairs.values);
    check(&two, &mass, &positions, 12);
}

#[test]
fn scale_changes_values_and_nothing_else() {
    let (matrix, mass, positions) = grid(40, 25, false);
    let base = smallest_eigenpairs(&matrix, &mass, &positions, 20, &|_| true).unwrap();
    let heavier: Vec<f64> = mass.iter().map(|m| m * 1e-6).collect();
    let scaled = smallest_eigenpairs(&matrix, &heavier, &positions, 20, &|_| true).unwrap();
    for (a, b) in base.values.iter().zip(&scaled.values) {
        assert!((a * 1e6 - b).abs() < 1e-8 * 1e6 * base.values[19]);
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let (matrix, mass, positions) = grid(90, 60, false);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| smallest_eigenpairs(&matrix, &mass, &positions, 30, &|_| true).unwrap())
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn stops_and_refuses() {
    let (matrix, mut mass, positions) = grid(40, 25, false);
    let stopped = smallest_eigenpairs(&matrix, &mass, &positions, 30, &|share| share < 0.5);
    assert_eq!(stopped, Err(NoEigenpairs::Stopped));
    mass[17] = 0.0;
    let refused = smallest_eigenpairs(&matrix, &mass, &positions, 3, &|_| true);
    assert!(matches!(refused, Err(NoEigenpairs::NotPositive(e)) if e.unknown == 17));
}
