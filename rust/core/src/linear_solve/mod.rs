//! Sparse Cholesky for symmetric positive definite matrices of surface meshes, many right-hand sides at once.

mod supernodal;

use glam::Vec3;

use supernodal::Supernodal;

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

impl SymmetricMatrix {
    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.column_starts.len().saturating_sub(1)
    }

    /// Diagonal entry of `unknown`.
    pub fn diagonal(&self, unknown: usize) -> f64 {
        self.values[self.column_starts[unknown]]
    }
}

/// The matrix is not positive definite: the pivot of this unknown was not positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NotPositive {
    /// Index of the unknown in the matrix.
    pub unknown: usize,
}

/// A pivot at or below this is zero but for rounding, `diagonal` being the entry it started from.
fn pivot_floor(diagonal: f64) -> f64 {
    64.0 * f64::EPSILON * diagonal
}

/// A Cholesky factorisation, kept for as many solves as wanted.
#[derive(Debug)]
pub struct Cholesky {
    factor: Option<Supernodal>,
}

impl Cholesky {
    /// Factors `matrix` (n unknowns). `positions` (n) guide the ordering only; the answer does not depend on them
    /// beyond rounding.
    ///
    /// # Errors
    /// [`NotPositive`] with the offending unknown.
    pub fn factor(matrix: &SymmetricMatrix, _positions: &[Vec3]) -> Result<Self, NotPositive> {
        let factor = (matrix.size() > 0).then(|| Supernodal::factor(matrix)).transpose()?;
        Ok(Self { factor })
    }

    /// Solves in place for `columns` right-hand sides: `rhs` is (n, columns), row-major.
    pub fn solve_in_place(&self, rhs: &mut [f64], columns: usize) {
        if let (Some(factor), true) = (&self.factor, columns > 0) {
            factor.solve_in_place(rhs, columns);
        }
    }

    /// Number of entries the factor stores.
    pub fn stored(&self) -> usize {
        self.factor.as_ref().map_or(0, Supernodal::stored)
    }
}
