//! How well a solution solves its system.

use rayon::prelude::*;

use crate::SymmetricMatrix;
use crate::substitute::solution::{RightHandSides, Solution};

/// The error that [`Solution::residual`] tells of.
pub(crate) fn backward_error(matrix: &SymmetricMatrix, solution: &Solution, rhs: &RightHandSides) -> f64 {
    let factors: Vec<f64> = (0..rhs.columns).map(share).collect();
    let combined = |i: usize| -> (f64, f64) {
        let b = rhs.row(i).map_or(0.0, |row| row.iter().zip(&factors).map(|(b, factor)| b * factor).sum());
        (solution.combined(i, &factors), b)
    };
    let (x, b): (Vec<f64>, Vec<f64>) = (0..matrix.size()).into_par_iter().with_min_len(256).map(combined).unzip();
    relative_defect(matrix, &x, &b)
}

/// What a column counts for in the combination that is measured.
pub(crate) fn share(column: usize) -> f64 {
    if (column as u32).wrapping_mul(0x9E37).wrapping_add(0x79B9) & 0x40 == 0 { 1.0 } else { -0.6 }
}

/// `|b - A x| / (|A| |x| + |b|)`, maximum norms.
pub(crate) fn relative_defect(matrix: &SymmetricMatrix, x: &[f64], b: &[f64]) -> f64 {
    let mut r = b.to_vec();
    let mut row_sums = vec![0.0; r.len()];
    for_each_entry(matrix, |i, j, value| {
        r[i] -= value * x[j];
        row_sums[i] += value.abs();
    });
    let scale = norm(&row_sums) * norm(x) + norm(b);
    if scale == 0.0 { norm(&r) } else { norm(&r) / scale }
}

/// Right-hand sides minus matrix times solution.
pub(crate) fn defect(matrix: &SymmetricMatrix, solution: &Solution, rhs: &RightHandSides) -> RightHandSides {
    let (n, columns) = (matrix.size(), rhs.columns);
    let x: Vec<f64> = (0..n).flat_map(|i| solution.row(i)).collect();
    let mut r = vec![0.0; n * columns];
    for (i, row) in r.chunks_exact_mut(columns).enumerate() {
        row.copy_from_slice(rhs.row(i).unwrap_or(&vec![0.0; columns]));
    }
    for_each_entry(matrix, |i, j, value| {
        let row = r[i * columns..][..columns].iter_mut();
        row.zip(&x[j * columns..]).for_each(|(r, x)| *r -= value * x);
    });
    RightHandSides::dense(n, columns, r)
}

/// Largest magnitude; not a number if one of the values is none.
fn norm(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| if value.abs() <= largest { largest } else { value.abs() })
}

/// Calls `visit(row, column, value)` for every entry of the whole matrix, both triangles.
fn for_each_entry(matrix: &SymmetricMatrix, mut visit: impl FnMut(usize, usize, f64)) {
    for (j, range) in matrix.column_starts.windows(2).enumerate() {
        for at in range[0]..range[1] {
            let (i, value) = (matrix.rows[at] as usize, matrix.values[at]);
            visit(i, j, value);
            if i != j {
                visit(j, i, value);
            }
        }
    }
}
