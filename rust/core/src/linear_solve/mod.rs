//! Sparse Cholesky for symmetric positive definite matrices of surface meshes, many right-hand sides at once.
//!
//! The way: `dissection` orders the unknowns by cutting the point cloud in half again and again (`bisection`, `patch`,
//! `vertex_cover`); `tree` finds the rows of each front; `factor` works through the fronts, children first (`walk`), with
//! `kernels` on memory laid out in row blocks (`blocks`, `buffer`), children's updates added by `extend_add`; `solve` goes
//! `forward` and `backward` through the same tree. `multifrontal` keeps it together and checks the first solution.
//!
//! What limits it: the factor is bound by arithmetic (at a million unknowns 1e11 operations against 2 GB), a solve for 60
//! bones too (four operations per entry of the factor and bone, 240 for the 16 bytes that the two passes read), a solve for
//! one bone by memory. Hence sums in registers over straight streams, and all bones in one go.
//!
//! Rejected, having been measured: minimum degree (twice the arithmetic at 100k unknowns) and METIS (a tenth less of it, but
//! ordering then takes longer than all the rest); threads inside the library's dense products (slower than one thread on
//! fronts of this size, and other bits on other thread counts); factors in `f32` with refinement (too ill-conditioned from
//! 100k unknowns on); iterative methods (none is near with 60 right-hand sides); updates as full squares (twice the memory,
//! and zeroing them took 15 % of the time).
//!
//! Every sum has one order, whatever the number of threads: the bits of a solution depend on the input and on the
//! instruction set only.

mod backward;
mod bisection;
mod blocks;
mod buffer;
mod dissection;
mod extend_add;
mod factor;
mod forward;
mod graph;
mod kernels;
mod multifrontal;
mod patch;
mod solve;
mod supernodal;
mod tree;
mod vertex_cover;
mod walk;

use glam::Vec3;

use multifrontal::Multifrontal;
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

/// A pivot at or below this is zero but for rounding, `diagonal` being the entry it started from. Singular matrices leave
/// up to 5e-13 of it, inpainting energies of a million sound vertices no less than 1e-9.
fn pivot_floor(diagonal: f64) -> f64 {
    1e-12 * diagonal
}

/// How a matrix is factored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Coordinate nested dissection and fronts on all threads; for surfaces.
    Multifrontal,
    /// Minimum degree and supernodes on one thread; for graphs that do not follow their positions.
    Supernodal,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 2] = [Self::Multifrontal, Self::Supernodal];
}

/// Matrices smaller than this are ordered so fast by minimum degree that fronts do not pay.
const FEW: usize = 300;

/// A Cholesky factorisation, kept for as many solves as wanted.
#[derive(Debug)]
pub struct Cholesky {
    factor: Factor,
}

#[derive(Debug)]
enum Factor {
    Empty,
    Multifrontal(Box<Multifrontal>),
    Supernodal(Box<Supernodal>),
}

impl Cholesky {
    /// Factors `matrix` (n unknowns). `positions` (n) guide the ordering only; the answer does not depend on them
    /// beyond rounding.
    ///
    /// # Errors
    /// [`NotPositive`] with the offending unknown.
    pub fn factor(matrix: &SymmetricMatrix, positions: &[Vec3]) -> Result<Self, NotPositive> {
        let method = if matrix.size() < FEW { Method::Supernodal } else { Method::Multifrontal };
        Self::factor_with(method, matrix, positions)
    }

    /// The same with a method of choice. Where separators turn out large, `Multifrontal` gives way to `Supernodal`.
    ///
    /// # Errors
    /// [`NotPositive`] with the offending unknown.
    pub fn factor_with(method: Method, matrix: &SymmetricMatrix, positions: &[Vec3]) -> Result<Self, NotPositive> {
        if matrix.size() == 0 {
            return Ok(Self { factor: Factor::Empty });
        }
        if method == Method::Multifrontal
            && let Some(factor) = Multifrontal::factor(matrix, positions)?
        {
            return Ok(Self { factor: Factor::Multifrontal(Box::new(factor)) });
        }
        Ok(Self { factor: Factor::Supernodal(Box::new(Supernodal::factor(matrix)?)) })
    }

    /// Solves in place for `columns` right-hand sides: `rhs` is (n, columns), row-major.
    pub fn solve_in_place(&self, rhs: &mut [f64], columns: usize) {
        match &self.factor {
            _ if columns == 0 => {}
            Factor::Empty => {}
            Factor::Multifrontal(factor) => factor.solve_in_place(rhs, columns),
            Factor::Supernodal(factor) => factor.solve_in_place(rhs, columns),
        }
    }

    /// Orders `matrix` as [`Method::Multifrontal`] does and counts the multiplications and additions its factorisation
    /// takes; a solve takes four per stored entry and right-hand side. `None` where separators turn out large.
    pub fn count_flops(matrix: &SymmetricMatrix, positions: &[Vec3]) -> Option<f64> {
        (matrix.size() > 0).then(|| Multifrontal::flops(matrix, positions)).flatten()
    }

    /// Number of entries the factor stores.
    pub fn stored(&self) -> usize {
        match &self.factor {
            Factor::Empty => 0,
            Factor::Multifrontal(factor) => factor.stored(),
            Factor::Supernodal(factor) => factor.stored(),
        }
    }
}
