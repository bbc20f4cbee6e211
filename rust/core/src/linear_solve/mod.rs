//! Sparse Cholesky for symmetric positive definite matrices of surface meshes, many right-hand sides at once.

use glam::Vec3;

/// Lower triangle (diagonal included) of a symmetric matrix, compressed by column, rows ascending.
#[derive(Debug, Clone, Default)]
pub struct SymmetricMatrix {
    /// Column starts, (n+1).
    pub column_starts: Vec<usize>,
    /// Row of every entry; the first of each column is the diagonal.
    pub rows: Vec<u32>,
    /// Value of every entry.
    pub values: Vec<f64>,
}

/// The matrix is not positive definite: the pivot of this unknown was not positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NotPositive {
    /// Index of the unknown in the matrix.
    pub unknown: usize,
}

/// A Cholesky factorisation, kept for as many solves as wanted.
#[derive(Debug)]
pub struct Cholesky {}

impl Cholesky {
    /// Factors `matrix` (n unknowns). `positions` (n) guide the ordering only; the answer does not depend on them
    /// beyond rounding.
    ///
    /// # Errors
    /// [`NotPositive`] with the offending unknown.
    pub fn factor(_matrix: &SymmetricMatrix, _positions: &[Vec3]) -> Result<Self, NotPositive> {
        unimplemented!()
    }

    /// Solves in place for `columns` right-hand sides: `rhs` is (n, columns), row-major.
    pub fn solve_in_place(&self, _rhs: &mut [f64], _columns: usize) {
        unimplemented!()
    }
}
