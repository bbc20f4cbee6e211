//! The sparse solver against faer's dense Cholesky and against the equation itself.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side};
use glam::Vec3;
use skinwright_core::linear_solve::{Cholesky, NotPositive, SymmetricMatrix};

/// A repeatable stream of numbers in [-1, 1).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// The lower triangle of `entries` (row, column, value), duplicates added up, every diagonal present.
fn assemble(n: usize, entries: &[(usize, usize, f64)]) -> SymmetricMatrix {
    let mut columns = vec![std::collections::BTreeMap::<u32, f64>::new(); n];
    for (i, column) in columns.iter_mut().enumerate() {
        column.insert(i as u32, 0.0);
    }
    for &(i, j, value) in entries {
        *columns[i.min(j)].entry(i.max(j) as u32).or_default() += value;
    }
    let mut matrix = SymmetricMatrix { column_starts: vec![0], ..Default::default() };
    for column in columns {
        matrix.rows.extend(column.keys());
        matrix.values.extend(column.values());
        matrix.column_starts.push(matrix.rows.len());
    }
    matrix
}

/// matrix * x, x (n, columns) row-major.
fn multiply(matrix: &SymmetricMatrix, x: &[f64], columns: usize) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    for j in 0..matrix.size() {
        for entry in matrix.column_starts[j]..matrix.column_starts[j + 1] {
            let (i, value) = (matrix.rows[entry] as usize, matrix.values[entry]);
            for c in 0..columns {
                y[i * columns + c] += value * x[j * columns + c];
                if i != j {
                    y[j * columns + c] += value * x[i * columns + c];
                }
            }
        }
    }
    y
}

/// (I + strength * graph Laplacian)^2, which couples two rings as the inpainting energy does.
fn squared_laplacian(n: usize, edges: &[(usize, usize)], strength: f64) -> SymmetricMatrix {
    let mut rows = vec![vec![(0usize, 1.0f64)]; n];
    for (i, row) in rows.iter_mut().enumerate() {
        row[0].0 = i;
    }
    for &(i, j) in edges {
        rows[i].push((j, -strength));
        rows[j].push((i, -strength));
        rows[i][0].1 += strength;
        rows[j][0].1 += strength;
    }
    let mut entries = Vec::new();
    for row in &rows {
        for &(i, a) in row {
            entries.extend(row.iter().filter(|&&(j, _)| j <= i).map(|&(j, b)| (i, j, a * b)));
        }
    }
    assemble(n, &entries)
}

fn grid(width: usize, height: usize) -> (SymmetricMatrix, Vec<Vec3>) {
    let at = |x: usize, y: usize| y * width + x;
    let mut noise = Noise(1);
    let mut edges = Vec::new();
    let mut positions = Vec::new();
    for y in 0..height {
        for x in 0..width {
            positions.push(Vec3::new(x as f32, y as f32, 0.3 * noise.next() as f32));
            if x + 1 < width {
                edges.push((at(x, y), at(x + 1, y)));
            }
            if y + 1 < height {
                edges.push((at(x, y), at(x, y + 1)));
            }
            if x + 1 < width && y + 1 < height {
                edges.push((at(x, y), at(x + 1, y + 1)));
            }
        }
    }
    (squared_laplacian(width * height, &edges, 3.0), positions)
}

fn check(name: &str, matrix: &SymmetricMatrix, positions: &[Vec3]) {
    let n = matrix.size();
    let factor = Cholesky::factor(matrix, positions).unwrap_or_else(|error| panic!("{name}: {error:?}"));
    for columns in [0, 1, 3] {
        let mut noise = Noise(columns as u64);
        let wanted: Vec<f64> = (0..n * columns).map(|_| noise.next()).collect();
        let rhs = multiply(matrix, &wanted, columns);
        let mut x = rhs.clone();
        factor.solve_in_place(&mut x, columns);
        let back = multiply(matrix, &x, columns);
        let scale = rhs.iter().fold(1e-300f64, |m, v| m.max(v.abs()));
        let residual = back.iter().zip(&rhs).fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) / scale;
        assert!(residual < 1e-10, "{name}, {columns} columns: residual {residual:e}");
    }
}

#[test]
fn solves_what_it_is_given() {
    check("empty", &SymmetricMatrix { column_starts: vec![0], ..Default::default() }, &[]);
    check("one", &assemble(1, &[(0, 0, 4.0)]), &[Vec3::ZERO]);
    let (matrix, positions) = grid(40, 30);
    check("grid", &matrix, &positions);
}

#[test]
fn agrees_with_a_dense_factorisation() {
    let (matrix, positions) = grid(12, 9);
    let n = matrix.size();
    let mut dense = Mat::zeros(n, n);
    for j in 0..n {
        for entry in matrix.column_starts[j]..matrix.column_starts[j + 1] {
            dense[(matrix.rows[entry] as usize, j)] = matrix.values[entry];
            dense[(j, matrix.rows[entry] as usize)] = matrix.values[entry];
        }
    }
    let mut noise = Noise(5);
    let rhs: Vec<f64> = (0..n * 2).map(|_| noise.next()).collect();
    let oracle = dense.llt(Side::Lower).unwrap().solve(Mat::from_fn(n, 2, |i, c| rhs[i * 2 + c]));
    let mut x = rhs.clone();
    Cholesky::factor(&matrix, &positions).unwrap().solve_in_place(&mut x, 2);
    for i in 0..n {
        for c in 0..2 {
            assert!((x[i * 2 + c] - oracle[(i, c)]).abs() < 1e-12);
        }
    }
}

#[test]
fn names_the_unknown_whose_pivot_fails() {
    let mut matrix = assemble(5, &[(0, 0, 1.0), (1, 1, 1.0), (2, 2, 1.0), (3, 3, -1.0), (4, 4, 1.0), (0, 4, 0.1)]);
    let positions = vec![Vec3::ZERO; 5];
    assert_eq!(Cholesky::factor(&matrix, &positions).unwrap_err(), NotPositive { unknown: 3 });
    matrix.values[matrix.column_starts[3]] = 0.0;
    assert_eq!(Cholesky::factor(&matrix, &positions).unwrap_err(), NotPositive { unknown: 3 });
}

#[test]
fn refuses_a_laplacian_that_nothing_holds() {
    let edges = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)];
    let entries: Vec<_> = edges.iter().flat_map(|&(i, j)| [(i, i, 0.3), (j, j, 0.3), (i, j, -0.3)]).collect();
    assert!(Cholesky::factor(&assemble(4, &entries), &[Vec3::ZERO; 4]).is_err());
}
