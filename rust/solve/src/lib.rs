//! Sparse Cholesky for symmetric positive definite matrices of surface meshes, many right-hand sides at once.
//!
//! The way: `dissection` orders the unknowns by cutting the point cloud in half again and again (`bisection`, `patch`,
//! `vertex_cover`); `tree` finds the rows of each front; `factor` works through the fronts, children first (`walk`), with
//! `kernels` on memory laid out in row blocks (`blocks`, `buffer`), children's updates added by `extend_add`; the substitution
//! goes `forward` and `backward` through the same tree. `multifrontal` keeps it together, and `accuracy` measures every solution.
//!
//! What limits it: the factor is bound by arithmetic (at a million unknowns 2.4e11 operations against 1.9 GB), a solve for 60
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
#![forbid(unsafe_code)]

mod accuracy;
pub mod eigen;
mod fronts;
mod kernels;
mod ordering;
mod substitute;
mod supernodal;

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};

use glam::Vec3;

use accuracy::{backward_error, defect, relative_defect, share};
use fronts::multifrontal::Multifrontal;
pub use substitute::forward::MOST_COLUMNS;
use substitute::rows::Layout;
pub use substitute::rows::{SparseRows, Term};
pub use substitute::solution::{RightHandSides, Solution};
pub use substitute::sparse::Workspace;
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

/// Why there is no factorisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Failure {
    /// The matrix is not positive definite.
    NotPositive(NotPositive),
    /// The caller asked to stop.
    Stopped,
}

/// For work that nobody stops.
static NEVER: AtomicBool = AtomicBool::new(false);

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

    /// The one that suits the size of a matrix.
    fn of(matrix: &SymmetricMatrix) -> Self {
        if matrix.size() < FEW { Self::Supernodal } else { Self::Multifrontal }
    }
}

/// Matrices smaller than this are ordered so fast by minimum degree that fronts do not pay.
const FEW: usize = 300;

/// The numbers in which a factor is stored; it is computed in `f64`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// `f32`, with fronts: for [`Cholesky::sparse`], at half the memory.
    Single,
    /// `f64`.
    Double,
}

impl Precision {
    /// Every precision.
    pub const ALL: [Self; 2] = [Self::Single, Self::Double];

    /// Residual (see [`Solution::residual`]) above which a solution is refined.
    fn accurate(self) -> f64 {
        if self == Self::Single { 1e-6 } else { 1e-14 }
    }

    /// Residual above which a factor is given up, if refinement does not bring it down.
    fn sound(self) -> f64 {
        if self == Self::Single { 1e-5 } else { 1e-12 }
    }
}

/// How often a solution is refined at most.
const REFINEMENTS: usize = 3;

/// A Cholesky factorisation, kept for as many solves as wanted.
///
/// # Example
/// A chain of springs, held at both ends by the diagonal and pulled in the middle:
/// ```
/// use glam::Vec3;
/// use skinwright_solve::{Cholesky, RightHandSides, SymmetricMatrix};
///
/// let matrix = SymmetricMatrix {
///     column_starts: vec![0, 2, 4, 5],
///     rows: vec![0, 1, 1, 2, 2],
///     values: vec![2.0, -1.0, 2.0, -1.0, 2.0],
/// };
/// let positions = [0.0, 1.0, 2.0].map(|x| Vec3::new(x, 0.0, 0.0));
/// let cholesky = Cholesky::factor(matrix, &positions).expect("it is positive definite");
/// let solution = cholesky.solve(&RightHandSides::dense(3, 1, vec![0.0, 1.0, 0.0]));
/// let found: Vec<f64> = (0..3).map(|i| solution.row(i).next().unwrap()).collect();
/// assert!(found.iter().zip([0.5, 1.0, 0.5]).all(|(x, wanted)| (x - wanted).abs() < 1e-12));
/// assert!(solution.residual() < 1e-14);
/// ```
#[derive(Debug)]
pub struct Cholesky {
    /// Kept to measure residuals: a tenth of the factor's size.
    matrix: Arc<SymmetricMatrix>,
    factor: Factor,
    /// What solves when the factor cannot.
    substitute: OnceLock<Option<Factor>>,
}

#[derive(Debug)]
enum Factor {
    Empty,
    Multifrontal(Box<Multifrontal>),
    Single(Box<Multifrontal<f32>>),
    Supernodal(Box<Supernodal>),
}

impl Cholesky {
    /// Factors `matrix` (n unknowns). `positions` (n) guide the ordering only; the answer does not depend on them
    /// beyond rounding.
    ///
    /// # Errors
    /// [`NotPositive`] with the offending unknown.
    pub fn factor(matrix: SymmetricMatrix, positions: &[Vec3]) -> Result<Self, NotPositive> {
        Self::factor_with(Method::of(&matrix), matrix, positions)
    }

    /// The same, unless `stop` is set meanwhile: it is heard within about a tenth of a second.
    ///
    /// # Errors
    /// [`Failure::NotPositive`], [`Failure::Stopped`].
    pub fn factor_until(matrix: SymmetricMatrix, positions: &[Vec3], stop: &AtomicBool) -> Result<Self, Failure> {
        Self::factor_in(Precision::Double, matrix, positions, stop)
    }

    /// The same, stored in a precision of choice.
    ///
    /// # Errors
    /// [`Failure::NotPositive`], [`Failure::Stopped`].
    pub fn factor_in(
        precision: Precision,
        matrix: SymmetricMatrix,
        positions: &[Vec3],
        stop: &AtomicBool,
    ) -> Result<Self, Failure> {
        let matrix = Arc::new(matrix);
        let factor = Factor::new(Method::of(&matrix), precision, &matrix, positions, stop)?;
        Ok(Self { matrix, factor, substitute: OnceLock::new() })
    }

    /// The same with a method of choice. Where separators turn out large, `Multifrontal` gives way to `Supernodal`.
    ///
    /// # Errors
    /// [`NotPositive`] with the offending unknown.
    pub fn factor_with(method: Method, matrix: SymmetricMatrix, positions: &[Vec3]) -> Result<Self, NotPositive> {
        let matrix = Arc::new(matrix);
        match Factor::new(method, Precision::Double, &matrix, positions, &NEVER) {
            Ok(factor) => Ok(Self { matrix, factor, substitute: OnceLock::new() }),
            Err(Failure::NotPositive(failed)) => Err(failed),
            Err(Failure::Stopped) => unreachable!("nobody stops it"),
        }
    }

    /// Solves for all right-hand sides. The solution is measured, refined where it needs to be, and sought with the other
    /// method should the factor turn out wrong.
    pub fn solve(&self, rhs: &RightHandSides) -> Solution<'_> {
        let solution = self.solve_with(&self.factor, rhs);
        if solution.residual <= self.factor.precision().sound() || matches!(self.factor, Factor::Supernodal(_)) {
            return solution;
        }
        let substitute = || Factor::new(Method::Supernodal, Precision::Double, &self.matrix, &[], &NEVER).ok();
        match self.substitute.get_or_init(substitute) {
            Some(substitute) => self.solve_with(substitute, rhs),
            None => solution,
        }
    }

    /// Solves where the solution matters, for right-hand sides that are mostly zero: of a factor in [`Precision::Single`]
    /// nothing else is touched. Nothing is measured or refined unless somebody asks for the [residual](SparseSolver::residual);
    /// where that is large, [`Self::solve`] looks for another factor, which is then used here as well.
    pub fn sparse(&self) -> SparseSolver<'_> {
        let factor = self.substitute.get().and_then(Option::as_ref).unwrap_or(&self.factor);
        let tree = if let Factor::Single(factor) = factor { Some(factor.tree()) } else { None };
        SparseSolver { matrix: &self.matrix, factor, layout: Layout { tree, unknowns: self.matrix.size() } }
    }

    fn solve_with<'f>(&self, factor: &'f Factor, rhs: &RightHandSides) -> Solution<'f> {
        let mut solution = factor.solve(rhs);
        solution.residual = backward_error(&self.matrix, &solution, rhs);
        for _ in 0..REFINEMENTS {
            if solution.residual <= factor.precision().accurate() {
                break;
            }
            solution.add(&factor.solve(&defect(&self.matrix, &solution, rhs)));
            solution.residual = backward_error(&self.matrix, &solution, rhs);
        }
        solution
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
            Factor::Single(factor) => factor.stored(),
            Factor::Supernodal(factor) => factor.stored(),
        }
    }
}

impl Factor {
    fn new(
        method: Method,
        precision: Precision,
        matrix: &Arc<SymmetricMatrix>,
        positions: &[Vec3],
        stop: &AtomicBool,
    ) -> Result<Self, Failure> {
        if matrix.size() == 0 {
            return Ok(Self::Empty);
        }
        let multifrontal = match (method, precision) {
            (Method::Supernodal, _) => None,
            (Method::Multifrontal, Precision::Single) => {
                Multifrontal::factor(matrix, positions, stop)?.map(|factor| Self::Single(Box::new(factor)))
            }
            (Method::Multifrontal, Precision::Double) => {
                Multifrontal::factor(matrix, positions, stop)?.map(|factor| Self::Multifrontal(Box::new(factor)))
            }
        };
        if let Some(factor) = multifrontal {
            return Ok(factor);
        }
        Ok(Self::Supernodal(Box::new(Supernodal::factor_until(matrix, stop)?)))
    }

    fn solve(&self, rhs: &RightHandSides) -> Solution<'_> {
        match self {
            Self::Multifrontal(factor) if rhs.columns > 0 => factor.solve(rhs),
            Self::Single(factor) if rhs.columns > 0 => factor.solve(rhs),
            Self::Supernodal(factor) if rhs.columns > 0 => factor.solve(rhs),
            _ => Solution { place: None, parts: Vec::new(), residual: 0.0 },
        }
    }

    fn precision(&self) -> Precision {
        if matches!(self, Self::Single(_)) { Precision::Single } else { Precision::Double }
    }
}

/// A factorisation that solves for rows which are mostly zero, see [`SparseRows`].
#[derive(Debug, Clone, Copy)]
pub struct SparseSolver<'f> {
    matrix: &'f SymmetricMatrix,
    factor: &'f Factor,
    layout: Layout<'f>,
}

impl<'f> SparseSolver<'f> {
    /// Rows made of what `append` adds to the list for each unknown: columns (below [`MOST_COLUMNS`]) and values, those of
    /// equal columns to be summed.
    pub fn collect(&self, append: impl Fn(usize, &mut Vec<(u32, f64)>) + Sync) -> SparseRows<'f> {
        self.layout.collect(append)
    }

    /// Solves for the sum of `terms`, each with a factor for every unknown, up to a magnitude that counts as zero, the `least`
    /// of each unknown. What is smaller may be left out; once `stop` is set the answer means nothing.
    pub fn solve(
        &self,
        terms: &[Term<'_, 'f>],
        least: impl Fn(usize) -> f64 + Sync,
        work: &mut Workspace,
        stop: &AtomicBool,
    ) -> SparseRows<'f> {
        let sum = self.layout.sum(terms);
        match self.factor {
            Factor::Single(factor) => factor.solve_sparse(&sum, &least, work, stop),
            factor => {
                let rhs = sum.to_dense();
                let solution = factor.solve(&rhs);
                self.layout.only_front(|k| solution.row(k), least, rhs.columns)
            }
        }
    }

    /// [`Solution::residual`] of what was found for the sum of `terms`, with what was left out.
    pub fn residual(&self, terms: &[Term<'_, 'f>], found: &SparseRows) -> f64 {
        let n = self.matrix.size();
        let mut b = vec![0.0; n];
        for (rows, factor) in terms {
            for (unknown, (sum, value)) in b.iter_mut().zip(rows.combined(n, share)).enumerate() {
                *sum += factor(unknown) * value;
            }
        }
        relative_defect(self.matrix, &found.combined(n, share), &b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fronts::multifrontal::tests::{chain, sines};

    /// Solves with a factor that is off by `error` and returns the largest difference from the true solution.
    fn solve_with_spoilt_factor(error: f64) -> f64 {
        let (matrix, positions) = chain(3000);
        let rhs = sines(3000, 70);
        let wanted = Cholesky::factor_with(Method::Supernodal, matrix.clone(), &positions).unwrap();
        let mut spoilt = Cholesky::factor(matrix, &positions).unwrap();
        let Factor::Multifrontal(factor) = &mut spoilt.factor else { panic!("a chain is a surface") };
        factor.spoil(1.0 + error);
        let (x, wanted) = (spoilt.solve(&rhs), wanted.solve(&rhs));
        let rows = (0..3000).flat_map(|i| x.row(i).zip(wanted.row(i)));
        rows.fold(0.0, |worst, (a, b)| worst.max((a - b).abs()))
    }

    #[test]
    fn refines_what_an_inaccurate_factor_leaves() {
        assert!(solve_with_spoilt_factor(1e-6) < 1e-8);
    }

    #[test]
    fn leaves_out_what_has_died_away() {
        let (matrix, positions) = chain(20_000);
        let exact = Cholesky::factor(matrix.clone(), &positions).unwrap();
        let factor = Cholesky::factor_in(Precision::Single, matrix, &positions, &NEVER).unwrap();
        let whole = exact.solve(&RightHandSides::sparse(20_000, 1, &[100], vec![1.0]));
        let sparse = factor.sparse();
        let data = sparse.collect(|i, row| row.extend((i == 100).then_some((37, 1.0))));
        let near = sparse.solve(&[(&data, &|_| 1.0)], |_| 1e-8, &mut Workspace::default(), &NEVER);
        let mut stored = 0;
        for i in 0..20_000 {
            let row: Vec<(u32, f64)> = near.row(i).collect();
            let value: f64 = row.iter().map(|&(_, value)| value).sum();
            assert!(row.iter().all(|&(column, _)| column == 37));
            assert!((value - whole.row(i).next().unwrap()).abs() <= 1e-8);
            stored += row.len();
        }
        assert!((100..15_000).contains(&stored), "{stored}");
        assert!(sparse.residual(&[(&data, &|_| 1.0)], &near) < 1e-6);
        assert!(sparse.residual(&[(&data, &|_| 1.1)], &near) > 1e-3);
    }

    #[test]
    fn solves_sparse_rows_as_any_others() {
        for (n, method) in [(3000, Method::Multifrontal), (200, Method::Supernodal)] {
            let (matrix, positions) = chain(n);
            let exact = Cholesky::factor_with(method, matrix.clone(), &positions).unwrap();
            let factor = Cholesky::factor_in(Precision::Single, matrix, &positions, &NEVER).unwrap();
            let value =
                |i: usize, column: usize| if i / 40 % 50 == column { (i * column) as f64 % 7.0 - 3.0 } else { 0.0 };
            let dense = (0..n).flat_map(|i| (0..60).map(move |column| 3.0 * value(i, column))).collect();
            let whole = exact.solve(&RightHandSides::dense(n, 60, dense));
            let sparse = factor.sparse();
            let data =
                sparse.collect(|i, row| row.extend((0..60).map(|c| (c as u32, value(i, c))).filter(|x| x.1 != 0.0)));
            let mut work = Workspace::default();
            // Once more with what is left in the memory.
            sparse.solve(&[(&data, &|_| 5.0)], |_| 0.0, &mut work, &NEVER);
            let found = sparse.solve(&[(&data, &|_| 1.0), (&data, &|_| 2.0)], |_| 0.0, &mut work, &NEVER);
            for i in 0..n {
                let mut wanted: Vec<f64> = whole.row(i).collect();
                found.row(i).for_each(|(column, value)| wanted[column as usize] -= value);
                assert!(wanted.iter().all(|difference| difference.abs() < 1e-4), "{i}");
            }
        }
    }

    #[test]
    fn replaces_a_wrong_factor() {
        assert!(solve_with_spoilt_factor(0.7) < 1e-8);
    }
}
