//! The solver for surfaces: nested dissection by coordinates and a multifrontal factor.

use std::ops::Range;
use std::sync::OnceLock;

use glam::Vec3;
use pulp::Arch;
use rayon::prelude::*;

use super::blocks::BLOCK;
use super::buffer::Buffer;
use super::dissection::dissect;
use super::factor::factor;
use super::graph::Graph;
use super::solve::{Columns, solve};
use super::supernodal::Supernodal;
use super::tree::Tree;
use super::{NotPositive, SymmetricMatrix};

/// Right-hand sides solved together.
const TOGETHER: usize = 64;
/// Residual, relative to the right-hand side and to matrix times solution, above which a solution is refined.
const RESIDUAL: f64 = 1e-12;
/// Refinements before the factor is given up.
const REFINEMENTS: usize = 3;

/// A multifrontal factorisation.
#[derive(Debug)]
pub(super) struct Multifrontal {
    tree: Tree,
    panels: Buffer,
    arch: Arch,
    /// Kept to measure residuals: a tenth of the factor's size.
    matrix: SymmetricMatrix,
    /// Whether the first solution left a small residual.
    trusted: OnceLock<bool>,
    /// What solves when this factor cannot.
    substitute: OnceLock<Option<Supernodal>>,
}

impl Multifrontal {
    /// Multiplications and additions that factoring `matrix` takes; `None` if it is no surface with these positions.
    pub(super) fn flops(matrix: &SymmetricMatrix, positions: &[Vec3]) -> Option<f64> {
        let graph = Graph::new(matrix);
        let tree = Tree::new(&graph, dissect(&graph, positions)?);
        Some(tree.fronts[tree.root()].subtree_flops)
    }

    /// Factors `matrix`; `None` if it is no surface with these positions.
    pub(super) fn factor(matrix: &SymmetricMatrix, positions: &[Vec3]) -> Result<Option<Self>, NotPositive> {
        let graph = Graph::new(matrix);
        let Some(dissection) = dissect(&graph, positions) else { return Ok(None) };
        let tree = Tree::new(&graph, dissection);
        let arch = Arch::new();
        let panels = factor(&tree, &graph, arch)?;
        let (trusted, substitute) = (OnceLock::new(), OnceLock::new());
        Ok(Some(Self { tree, panels, arch, matrix: matrix.clone(), trusted, substitute }))
    }

    /// Solves in place, `rhs` (n, columns) row-major.
    pub(super) fn solve_in_place(&self, rhs: &mut [f64], columns: usize) {
        if let Some(Some(substitute)) = self.substitute.get() {
            return substitute.solve_in_place(rhs, columns);
        }
        let n = self.matrix.size();
        let mut x = Buffer::zeroed(n * columns.min(TOGETHER).next_multiple_of(BLOCK));
        for first in (0..columns).step_by(TOGETHER) {
            let count = (columns - first).min(TOGETHER);
            let width = count.next_multiple_of(BLOCK);
            let x = &mut x[..n * width];
            if !self.solve(Columns { rhs, columns, first, count, width }, x)
                && first == 0
                && let Some(substitute) = self.substitute.get_or_init(|| Supernodal::factor(&self.matrix).ok())
            {
                return substitute.solve_in_place(rhs, columns);
            }
            rhs.par_chunks_exact_mut(columns).with_min_len(512).enumerate().for_each(|(unknown, row)| {
                let place = self.tree.place[unknown] as usize * width;
                row[first..first + count].copy_from_slice(&x[place..place + count]);
            });
        }
    }

    /// Solves for some columns and checks the first answers of a new factor. False if refinement cannot mend them.
    fn solve(&self, columns: Columns, x: &mut [f64]) -> bool {
        solve(&self.tree, &self.panels, self.arch, columns, x);
        let is_sound = |x: &[f64]| columns.nonzero_column().map(|column| self.residual(columns, x, column) <= RESIDUAL);
        if self.trusted.get().copied().or_else(|| is_sound(x)).is_none_or(|sound| *self.trusted.get_or_init(|| sound)) {
            return true;
        }
        (0..REFINEMENTS).any(|_| {
            self.refine(columns, x);
            is_sound(x).is_none_or(|sound| sound)
        })
    }

    /// Solves for what is left of the right-hand side and adds that to `x`.
    fn refine(&self, columns: Columns, x: &mut [f64]) {
        let Columns { count, width, .. } = columns;
        let (rhs, _) = self.defect(columns, x, 0..count);
        let mut correction = Buffer::zeroed(x.len());
        let left = Columns { rhs: &rhs, columns: count, first: 0, count, width };
        solve(&self.tree, &self.panels, self.arch, left, &mut correction);
        x.iter_mut().zip(correction.iter()).for_each(|(x, correction)| *x += correction);
    }

    /// Largest defect of one column, relative to the largest term that enters it.
    fn residual(&self, columns: Columns, x: &[f64], column: usize) -> f64 {
        let (defect, scale) = self.defect(columns, x, column..column + 1);
        // Not `f64::max`, which passes over what is not a number.
        defect.iter().fold(0.0, |largest, value| if value.abs() <= largest { largest } else { value.abs() }) / scale
    }

    /// Right-hand side minus matrix times solution for the columns `shown` (n, shown), and the largest term in it.
    fn defect(&self, columns: Columns, x: &[f64], shown: Range<usize>) -> (Vec<f64>, f64) {
        let (n, count) = (self.matrix.size(), shown.len());
        let mut solution = Vec::with_capacity(n * count);
        let mut defect = Vec::with_capacity(n * count);
        for (unknown, &place) in self.tree.place.iter().enumerate() {
            solution.extend_from_slice(&x[place as usize * columns.width..][shown.clone()]);
            defect.extend_from_slice(&columns.row(unknown)[shown.clone()]);
        }
        let mut scale = defect.iter().fold(f64::MIN_POSITIVE, |scale, value| scale.max(value.abs()));
        for j in 0..n {
            let entries = self.matrix.column_starts[j]..self.matrix.column_starts[j + 1];
            for (&i, &value) in self.matrix.rows[entries.clone()].iter().zip(&self.matrix.values[entries]) {
                let i = i as usize;
                for c in 0..count {
                    let term = value * solution[j * count + c];
                    scale = scale.max(term.abs());
                    defect[i * count + c] -= term;
                    if i != j {
                        defect[j * count + c] -= value * solution[i * count + c];
                    }
                }
            }
        }
        (defect, scale)
    }

    /// Number of stored entries of the factor.
    pub(super) fn stored(&self) -> usize {
        self.panels.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of unknowns, each coupled to its next thirty.
    fn chain(n: usize) -> (SymmetricMatrix, Vec<Vec3>) {
        let mut matrix = SymmetricMatrix { column_starts: vec![0], ..Default::default() };
        for j in 0..n {
            for offset in 0..31.min(n - j) {
                matrix.rows.push((j + offset) as u32);
                matrix.values.push(if offset == 0 { 60.5 } else { -1.0 });
            }
            matrix.column_starts.push(matrix.rows.len());
        }
        (matrix, (0..n).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect())
    }

    /// Solves with a factor that is off by `error` and returns the largest difference from the true solution.
    fn solve_with_spoilt_factor(error: f64) -> f64 {
        let (matrix, positions) = chain(3000);
        let mut factor = Multifrontal::factor(&matrix, &positions).unwrap().unwrap();
        factor.panels.iter_mut().for_each(|value| *value *= 1.0 + error);
        let rhs: Vec<f64> = (0..3000 * 70).map(|i| (i as f64).sin()).collect();
        let (mut x, mut wanted) = (rhs.clone(), rhs);
        factor.solve_in_place(&mut x, 70);
        Supernodal::factor(&matrix).unwrap().solve_in_place(&mut wanted, 70);
        x.iter().zip(&wanted).fold(0.0, |worst, (a, b)| worst.max((a - b).abs()))
    }

    /// Every instruction set this machine has.
    fn instruction_sets() -> Vec<Arch> {
        let mut sets = vec![Arch::Scalar];
        #[cfg(target_arch = "x86_64")]
        {
            sets.extend(pulp::x86::V3::try_new().map(Arch::V3));
            sets.extend(pulp::x86::V4::try_new().map(Arch::V4));
        }
        sets
    }

    #[test]
    fn solves_on_every_instruction_set() {
        let (matrix, positions) = chain(1500);
        let rhs: Vec<f64> = (0..1500 * 29).map(|i| (i as f64).sin()).collect();
        let mut wanted = rhs.clone();
        Supernodal::factor(&matrix).unwrap().solve_in_place(&mut wanted, 29);
        for arch in instruction_sets() {
            let mut solver = Multifrontal::factor(&matrix, &positions).unwrap().unwrap();
            solver.arch = arch;
            solver.panels = factor(&solver.tree, &Graph::new(&matrix), arch).unwrap();
            let mut x = rhs.clone();
            solver.solve_in_place(&mut x, 29);
            let worst = x.iter().zip(&wanted).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
            assert!(worst < 1e-9 && solver.trusted.get() == Some(&true), "{arch:?}: {worst:e}");
        }
    }

    #[test]
    fn refines_what_an_inaccurate_factor_leaves() {
        assert!(solve_with_spoilt_factor(1e-6) < 1e-8);
    }

    #[test]
    fn replaces_a_wrong_factor() {
        assert!(solve_with_spoilt_factor(0.7) < 1e-8);
    }
}
