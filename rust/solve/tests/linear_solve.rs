//! The sparse solver against faer's dense Cholesky and against the equation itself.

use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use glam::Vec3;
use skinwright_solve::{Cholesky, Method, NotPositive, RightHandSides, SymmetricMatrix};

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

/// Edges of a triangulated grid; the last column joins the first if it is `closed`.
fn grid_edges(width: usize, height: usize, closed: bool) -> Vec<(usize, usize)> {
    let mut edges = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (right, here) = ((x + 1) % width, y * width + x);
            if right > x || closed {
                edges.push((here, y * width + right));
            }
            if y + 1 < height {
                edges.push((here, here + width));
                if right > x || closed {
                    edges.push((here, (y + 1) * width + right));
                }
            }
        }
    }
    edges
}

type Case = (&'static str, SymmetricMatrix, Vec<Vec3>);

fn grid(name: &'static str, width: usize, height: usize) -> Case {
    let mut noise = Noise(1);
    let position = |i: usize| Vec3::new((i % width) as f32, (i / width) as f32, 0.3 * noise.next() as f32);
    let positions = (0..width * height).map(position).collect();
    (name, squared_laplacian(width * height, &grid_edges(width, height, false), 3.0), positions)
}

/// A closed tube with folds, much coupled.
fn tube(name: &'static str, around: usize, along: usize) -> Case {
    let position = |i: usize| {
        let angle = (i % around) as f32 / around as f32 * std::f32::consts::TAU;
        let radius = 1.0 + 0.2 * (9.0 * angle).sin();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), (i / around) as f32 * 0.02)
    };
    let positions = (0..around * along).map(position).collect();
    (name, squared_laplacian(around * along, &grid_edges(around, along, true), 100.0), positions)
}

/// A skirt without a fold: from every side as many vertices lie on the cutting plane as the rounding lets.
fn cone(name: &'static str, around: usize, along: usize) -> Case {
    let position = |i: usize| {
        let angle = (i % around) as f64 / around as f64 * std::f64::consts::TAU;
        let height = 1.8 - 1.55 * (i / around) as f64 / around as f64;
        let radius = 0.32 + 0.9 * (1.1 - height).max(0.0);
        Vec3::new((radius * angle.cos()) as f32, (radius * angle.sin()) as f32, height as f32)
    };
    let positions = (0..around * along).map(position).collect();
    (name, squared_laplacian(around * along, &grid_edges(around, along, true), 100.0), positions)
}

/// A graph that has nothing to do with the positions of its vertices.
fn random_graph(name: &'static str, n: usize, edges: usize) -> Case {
    let mut noise = Noise(7);
    let mut index = || ((noise.next() + 1.0) / 2.0 * n as f64) as usize;
    let edges: Vec<_> = (0..edges).map(|_| (index(), index())).filter(|(i, j)| i != j).collect();
    let positions = (0..n).map(|_| Vec3::new(noise.next() as f32, noise.next() as f32, noise.next() as f32)).collect();
    (name, squared_laplacian(n, &edges, 0.7), positions)
}

/// Several cases as one matrix.
fn side_by_side(name: &'static str, cases: &[Case]) -> Case {
    let (mut matrix, mut positions) = (SymmetricMatrix { column_starts: vec![0], ..Default::default() }, Vec::new());
    for (_, part, places) in cases {
        let (first, entries) = (positions.len() as u32, matrix.rows.len());
        matrix.rows.extend(part.rows.iter().map(|row| row + first));
        matrix.values.extend(&part.values);
        matrix.column_starts.extend(part.column_starts[1..].iter().map(|start| start + entries));
        positions.extend(places.iter().map(|&place| place + Vec3::X * first as f32));
    }
    (name, matrix, positions)
}

fn arrow(n: usize) -> Case {
    let entries: Vec<_> =
        (0..n).flat_map(|i| [(i, i, 2.0), (i, n / 2, if i == n / 2 { n as f64 } else { 1.0 })]).collect();
    ("arrow", assemble(n, &entries), (0..n).map(|i| Vec3::splat(i as f32)).collect())
}

fn with_positions(name: &'static str, (_, matrix, positions): Case, place: impl Fn(usize, Vec3) -> Vec3) -> Case {
    (name, matrix, positions.into_iter().enumerate().map(|(i, position)| place(i, position)).collect())
}

/// Matrices that the solver may meet, from the plain to the degenerate.
fn cases() -> Vec<Case> {
    let diagonal: Vec<_> = (0..40).map(|i| (i, i, 1.0 + i as f64)).collect();
    let mut tiny = grid("tiny numbers", 25, 20);
    tiny.1.values.iter_mut().for_each(|value| *value *= 1e-200);
    vec![
        ("empty", SymmetricMatrix { column_starts: vec![0], ..Default::default() }, vec![]),
        ("no starts at all", SymmetricMatrix::default(), vec![]),
        ("one", assemble(1, &[(0, 0, 4.0)]), vec![Vec3::ZERO]),
        ("diagonal", assemble(40, &diagonal), (0..40).map(|i| Vec3::Y * i as f32).collect()),
        grid("seven", 7, 1),
        grid("two blocks", 4, 4),
        grid("thirty-three", 3, 11),
        grid("small grid", 23, 19),
        grid("grid", 70, 60),
        grid("large grid", 130, 110),
        grid("strip", 2000, 3),
        tube("tube", 180, 50),
        cone("cone", 141, 60),
        cone("long cone", 141, 100),
        cone("wide cone", 387, 60),
        side_by_side("islands", &[grid("", 30, 20), grid("", 1, 1), grid("", 9, 9), tube("", 50, 20), grid("", 2, 1)]),
        side_by_side("large islands", &[grid("", 70, 70), tube("", 90, 60)]),
        arrow(400),
        random_graph("random graph", 600, 900),
        random_graph("large random graph", 5000, 5500),
        with_positions("pairs of coincident positions", grid("", 70, 70), |i, p| {
            (p / 2.0).floor() + Vec3::Z * (i % 2) as f32 * 0.0
        }),
        with_positions("few distinct positions", grid("", 70, 70), |i, _| Vec3::X * (i % 3) as f32),
        with_positions("equal positions", grid("", 60, 50), |_, _| Vec3::ONE),
        with_positions("many equal positions", grid("", 80, 80), |_, _| Vec3::ONE),
        with_positions("collinear", grid("", 60, 50), |_, p| Vec3::ONE * p.x),
        with_positions("huge coordinates", grid("", 60, 50), |_, p| p * 1e30),
        with_positions("tiny coordinates", tube("", 90, 60), |_, p| p * 1e-25),
        with_positions("not finite", grid("", 40, 50), |i, p| if i % 7 == 0 { Vec3::NAN } else { p }),
        tiny,
    ]
}

/// The solutions for `rhs` (n, columns), row-major as they are.
fn solve(factor: &Cholesky, n: usize, columns: usize, rhs: Vec<f64>) -> Vec<f64> {
    let solution = factor.solve(&RightHandSides::dense(n, columns, rhs));
    (0..n).flat_map(|unknown| solution.row(unknown)).collect()
}

fn noise(n: usize, seed: usize) -> Vec<f64> {
    let mut noise = Noise(seed as u64);
    (0..n).map(|_| noise.next()).collect()
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |largest, value| if value.abs() <= largest { largest } else { value.abs() })
}

fn differences(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    largest(a.iter().zip(b).map(|(a, b)| a - b))
}

#[test]
fn leaves_no_residual() {
    for method in Method::ALL {
        for (name, matrix, positions) in cases() {
            let factor = Cholesky::factor_with(method, matrix.clone(), &positions);
            let factor = factor.unwrap_or_else(|error| panic!("{method:?}, {name}: {error:?}"));
            for columns in [0, 1, 3, 60, 70] {
                let rhs = multiply(&matrix, &noise(matrix.size() * columns, columns), columns);
                let x = solve(&factor, matrix.size(), columns, rhs.clone());
                let scale = largest(rhs.iter().copied());
                let residual = differences(&multiply(&matrix, &x, columns), &rhs);
                assert!(residual <= 1e-10 * scale, "{method:?}, {name}, {columns} columns: {residual:e} of {scale:e}");
            }
        }
    }
}

#[test]
fn agrees_with_the_oracle() {
    for method in Method::ALL {
        for (name, matrix, positions) in cases().into_iter().filter(|case| case.1.size() > 0) {
            let n = matrix.size();
            let rhs = noise(n * 2, 5);
            let right = Mat::from_fn(n, 2, |i, c| rhs[i * 2 + c]);
            let wanted = if n <= 600 { dense_solve(&matrix, &right) } else { sparse_solve(&matrix, &right) };
            let factor = Cholesky::factor_with(method, matrix, &positions).unwrap();
            let x = solve(&factor, n, 2, rhs);
            let wanted: Vec<f64> = (0..n * 2).map(|i| wanted[(i / 2, i % 2)]).collect();
            let error = differences(&x, &wanted) / largest(wanted);
            assert!(error < 1e-9, "{method:?}, {name}: {error:e}");
        }
    }
}

fn dense_solve(matrix: &SymmetricMatrix, rhs: &Mat<f64>) -> Mat<f64> {
    let mut dense = Mat::zeros(matrix.size(), matrix.size());
    for j in 0..matrix.size() {
        for entry in matrix.column_starts[j]..matrix.column_starts[j + 1] {
            dense[(matrix.rows[entry] as usize, j)] = matrix.values[entry];
            dense[(j, matrix.rows[entry] as usize)] = matrix.values[entry];
        }
    }
    dense.llt(Side::Lower).unwrap().solve(rhs)
}

fn sparse_solve(matrix: &SymmetricMatrix, rhs: &Mat<f64>) -> Mat<f64> {
    let column = |entry: usize| matrix.column_starts.partition_point(|&start| start <= entry) - 1;
    let entries: Vec<_> = (0..matrix.values.len())
        .map(|entry| Triplet::new(matrix.rows[entry] as usize, column(entry), matrix.values[entry]))
        .collect();
    let sparse = SparseColMat::<usize, f64>::try_new_from_triplets(matrix.size(), matrix.size(), &entries).unwrap();
    sparse.sp_cholesky(Side::Lower).unwrap().solve(rhs)
}

#[test]
fn names_the_unknown_whose_pivot_fails() {
    for method in Method::ALL {
        for (_, mut matrix, positions) in [grid("", 3, 3), grid("", 40, 30), tube("", 120, 50)] {
            for unknown in [0, matrix.size() / 3, matrix.size() - 1] {
                let entry = matrix.column_starts[unknown];
                for bad in [-1e3, f64::NAN] {
                    let good = std::mem::replace(&mut matrix.values[entry], bad);
                    let error = Cholesky::factor_with(method, matrix.clone(), &positions).unwrap_err();
                    assert_eq!(error, NotPositive { unknown }, "{method:?}, {bad}");
                    matrix.values[entry] = good;
                }
            }
        }
    }
}

#[test]
fn refuses_a_laplacian_that_nothing_holds() {
    for method in Method::ALL {
        for (width, height) in [(3, 3), (20, 17), (50, 90)] {
            let weighted = |(k, (i, j)): (usize, (usize, usize))| {
                let weight = 0.1 + (k % 7) as f64;
                [(i, i, weight), (j, j, weight), (i, j, -weight)]
            };
            let entries: Vec<_> = grid_edges(width, height, false).into_iter().enumerate().flat_map(weighted).collect();
            let matrix = assemble(width * height, &entries);
            let (_, _, positions) = grid("", width, height);
            assert!(Cholesky::factor_with(method, matrix, &positions).is_err(), "{method:?}, {width} x {height}");
        }
    }
}

#[test]
fn gives_the_same_bits_on_any_number_of_threads() {
    for (name, matrix, positions) in [grid("grid", 150, 130), tube("tube", 300, 60)] {
        let on_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let n = matrix.size();
            let factor = || Cholesky::factor(matrix.clone(), &positions).unwrap();
            let x = pool.install(|| solve(&factor(), n, 21, noise(n * 21, 3)));
            x.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        let one = on_threads(1);
        assert!(one == on_threads(2) && one == on_threads(3), "{name}");
    }
}

#[test]
fn leaves_zero_columns_exactly_zero() {
    for method in Method::ALL {
        let (_, matrix, positions) = tube("", 150, 60);
        let n = matrix.size();
        let factor = Cholesky::factor_with(method, matrix, &positions).unwrap();
        for columns in [12, 100] {
            let is_zero = |column: usize| column % 3 == 1;
            let mut rhs = noise(n * columns, 9);
            rhs.iter_mut().enumerate().filter(|(i, _)| is_zero(i % columns)).for_each(|(_, value)| *value = 0.0);
            let x = solve(&factor, n, columns, rhs);
            assert!(x.iter().enumerate().all(|(i, &value)| (value == 0.0) == is_zero(i % columns)));
        }
    }
}

/// Right-hand sides that live on few unknowns each take the short way through the tree, and need not be stored in full.
#[test]
fn solves_sparse_right_hand_sides_as_it_does_full_ones() {
    for method in Method::ALL {
        let (_, matrix, positions) = grid("", 90, 80);
        let (n, columns) = (matrix.size(), 29);
        let factor = Cholesky::factor_with(method, matrix, &positions).unwrap();
        let mut sparse = vec![0.0; n * columns];
        let mut full = noise(n * (columns + 1), 2);
        for i in 0..n {
            for column in 0..columns {
                let value = if i * 13 % 977 == column { 1.0 + i as f64 } else { 0.0 };
                sparse[i * columns + column] = value;
                full[i * (columns + 1) + column] = value;
            }
        }
        let rows: Vec<u32> = (0..n as u32).rev().filter(|&i| (i as usize * 13 % 977) < columns).collect();
        let stored = rows.iter().flat_map(|&i| sparse[i as usize * columns..][..columns].to_vec()).collect();
        let banded = factor.solve(&RightHandSides::sparse(n, columns, &rows, stored));
        let banded: Vec<f64> = (0..n).flat_map(|i| banded.row(i)).collect();
        let sparse = solve(&factor, n, columns, sparse);
        let full = solve(&factor, n, columns + 1, full);
        let full: Vec<f64> = full.chunks_exact(columns + 1).flat_map(|row| &row[..columns]).copied().collect();
        assert!(banded == sparse, "{method:?}");
        assert!(differences(&sparse, &full) <= 1e-12 * largest(full), "{method:?}");
    }
}
