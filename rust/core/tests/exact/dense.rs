//! Dense systems, written from the papers: cotangent stiffness, mixed Voronoi areas, and elimination with pivoting.

use crate::common::Fixture;
use glam::{DVec3, Vec3};

pub type Matrix = Vec<Vec<f64>>;

/// S (V, V) and M (V): half cotangents, and the areas of Meyer et al. 2003, section 3.3.
pub fn stiffness_and_masses(mesh: &Fixture) -> (Matrix, Vec<f64>) {
    let n = mesh.positions.len();
    let (mut stiffness, mut masses) = (vec![vec![0.0; n]; n], vec![0.0; n]);
    for t in &mesh.triangles {
        let corners = t.map(|i| Vec3::from(mesh.positions[i as usize]).as_dvec3());
        let angle = |k: usize| (corners[(k + 1) % 3] - corners[k]).angle_between(corners[(k + 2) % 3] - corners[k]);
        let angles = [0, 1, 2].map(angle);
        let area = area_of(corners);
        let is_obtuse = |angle: f64| angle > std::f64::consts::FRAC_PI_2;
        for k in 0..3 {
            let (i, j) = (t[(k + 1) % 3] as usize, t[(k + 2) % 3] as usize);
            let half_cotangent = 0.5 / angles[k].tan();
            stiffness[i][i] += half_cotangent;
            stiffness[j][j] += half_cotangent;
            stiffness[i][j] -= half_cotangent;
            stiffness[j][i] -= half_cotangent;
            if angles.into_iter().any(is_obtuse) {
                masses[t[k] as usize] += if is_obtuse(angles[k]) { area / 2.0 } else { area / 4.0 };
            } else {
                let squared = corners[(k + 1) % 3].distance_squared(corners[(k + 2) % 3]);
                masses[i] += squared * half_cotangent / 4.0;
                masses[j] += squared * half_cotangent / 4.0;
            }
        }
    }
    (stiffness, masses)
}

fn area_of([a, b, c]: [DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length() / 2.0
}

/// S + l^2 S M^-1 S.
pub fn energy(stiffness: &Matrix, masses: &[f64], length: f64) -> Matrix {
    let n = masses.len();
    let second = |i: usize, j: usize| (0..n).map(|k| stiffness[i][k] * stiffness[k][j] / masses[k]).sum::<f64>();
    (0..n).map(|i| (0..n).map(|j| stiffness[i][j] + length * length * second(i, j)).collect()).collect()
}

/// The solutions (n, columns) of `matrix` (n, n) for right-hand sides (n, columns).
pub fn solved(mut matrix: Matrix, mut right: Matrix) -> Matrix {
    let n = matrix.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| matrix[a][k].abs().total_cmp(&matrix[b][k].abs())).unwrap();
        matrix.swap(k, pivot);
        right.swap(k, pivot);
        for r in (0..n).filter(|&r| r != k) {
            let factor = matrix[r][k] / matrix[k][k];
            for c in 0..n {
                matrix[r][c] -= factor * matrix[k][c];
            }
            for c in 0..right[r].len() {
                right[r][c] -= factor * right[k][c];
            }
        }
    }
    (0..n).map(|k| right[k].iter().map(|x| x / matrix[k][k]).collect()).collect()
}

/// The rows that minimise `sum w' Q w + sum over the given of b |w - s|^2`; `given` are (vertex, b, row),
/// `fixed` (vertex, row).
pub fn minimiser<const C: usize>(q: &Matrix, given: &[(usize, f64, [f64; C])], fixed: &[(usize, [f64; C])]) -> Matrix {
    let n = q.len();
    let (mut matrix, mut right) = (q.clone(), vec![vec![0.0; C]; n]);
    for &(i, b, row) in given {
        matrix[i][i] += b;
        (0..C).for_each(|c| right[i][c] += b * row[c]);
    }
    for &(i, row) in fixed {
        matrix[i] = (0..n).map(|j| f64::from(u8::from(i == j))).collect();
        right[i] = row.to_vec();
    }
    solved(matrix, right)
}

/// Rows pulled towards given ones over lengths of their own, by four solves: what `fill::screened` documents.
pub struct Screened {
    pub stiffness: Matrix,
    pub masses: Vec<f64>,
    /// C, 0 where nothing is given or the row is fixed.
    pub confidence: Vec<f64>,
    pub is_fixed: Vec<bool>,
    /// The given rows.
    pub rows: Vec<Option<Vec<f64>>>,
}

/// a of the documentation, squared.
const REACH_SQUARED: f64 = 2.25;

impl Screened {
    /// The rows of all vertices; `kept(i, j)` is the share of the change from soft vertex i to j that stays.
    pub fn solved(&self, kept: impl Fn(usize, usize) -> f64) -> Matrix {
        let n = self.masses.len();
        let unknowns: Vec<usize> = (0..n).filter(|&i| !self.is_fixed[i]).collect();
        let c = |i: usize| self.confidence[i];
        let entry = |i: usize, j: usize| self.stiffness[i][j] + if i == j { c(i) } else { 0.0 };
        let matrix: Matrix = unknowns.iter().map(|&i| unknowns.iter().map(|&j| entry(i, j)).collect()).collect();
        let g: Matrix = (0..n).map(|i| self.brought(i, &kept)).collect();
        let zero = vec![0.0; g[0].len()];
        let given = |i: usize| self.rows[i].as_ref().unwrap_or(&zero);
        let solve = |right: &dyn Fn(usize, usize, usize) -> f64| {
            let row = |(k, &i): (usize, &usize)| (0..zero.len()).map(|column| right(k, i, column)).collect();
            solved(matrix.clone(), unknowns.iter().enumerate().map(row).collect())
        };
        let x1 = solve(&|_, i, column| c(i) * given(i)[column] + g[i][column]);
        let x2 = solve(&|k, i, column| c(i) * x1[k][column] + g[i][column]);
        let defect = |k: usize, i: usize, column: usize| {
            (given(i)[column] - x2[k][column]) / REACH_SQUARED + x1[k][column] - x2[k][column]
        };
        let u = solve(&|k, i, column| c(i) * c(i) / self.masses[i] * defect(k, i, column));
        let w = solve(&|k, i, column| c(i) * x2[k][column] + self.masses[i] * u[k][column] + g[i][column]);
        let row = |i: usize| unknowns.binary_search(&i).map_or_else(|_| given(i).clone(), |k| w[k].clone());
        (0..n).map(row).collect()
    }

    /// g of vertex i: what fixed rows and kept changes bring.
    fn brought(&self, i: usize, kept: &impl Fn(usize, usize) -> f64) -> Vec<f64> {
        let mut sum = vec![0.0; self.rows.iter().flatten().next().map_or(0, Vec::len)];
        for (j, row) in self.rows.iter().enumerate().filter(|&(j, _)| j != i) {
            let (Some(row), coupling) = (row, -self.stiffness[i][j]) else { continue };
            for (column, sum) in sum.iter_mut().enumerate() {
                *sum += if self.is_fixed[j] { coupling * row[column] } else { 0.0 };
                if let Some(own) = self.rows[i].as_ref().filter(|_| self.confidence[i] > 0.0) {
                    *sum += coupling * kept(i, j) * (own[column] - row[column]);
                }
            }
        }
        sum
    }
}
