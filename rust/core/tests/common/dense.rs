//! Dense systems, written from the papers: cotangent stiffness, mixed Voronoi areas, and elimination with pivoting.

use super::common::Fixture;
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
