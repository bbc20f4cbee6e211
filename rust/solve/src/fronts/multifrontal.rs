//! The solver for surfaces: nested dissection by coordinates and a multifrontal factor.

use std::sync::atomic::{AtomicBool, Ordering};

use glam::Vec3;
use pulp::Arch;

use crate::fronts::buffer::Buffer;
use crate::fronts::factor::factor;
use crate::fronts::tree::Tree;
use crate::kernels::Real;
use crate::ordering::dissection::dissect;
use crate::ordering::graph::Graph;
use crate::substitute::backward::backward;
use crate::substitute::columns::Columns;
use crate::substitute::forward::{Stacks, activity, forward};
use crate::substitute::rows::{SparseRows, Sum};
use crate::substitute::solution::{Part, RightHandSides, Solution};
use crate::substitute::sparse::{self, Workspace};
use crate::{Failure, SymmetricMatrix};

/// Right-hand sides solved together.
const TOGETHER: usize = 64;

/// A multifrontal factorisation, made in `f64` and stored in `R`.
#[derive(Debug)]
pub(crate) struct Multifrontal<R = f64> {
    tree: Tree,
    panels: Buffer<R>,
    arch: Arch,
}

impl Multifrontal {
    /// Multiplications and additions that factoring `matrix` takes; `None` if it is no surface with these positions.
    pub(crate) fn flops(matrix: &SymmetricMatrix, positions: &[Vec3]) -> Option<f64> {
        let graph = Graph::new(matrix);
        let tree = Tree::new(&graph, dissect(&graph, positions, &crate::NEVER)?);
        Some(tree.fronts[tree.root()].subtree_flops)
    }
}

impl<R: Real> Multifrontal<R> {
    /// Factors `matrix`; `None` if it is no surface with these positions.
    pub(crate) fn factor(
        matrix: &SymmetricMatrix,
        positions: &[Vec3],
        stop: &AtomicBool,
    ) -> Result<Option<Self>, Failure> {
        let graph = Graph::new(matrix);
        let Some(dissection) = dissect(&graph, positions, stop) else {
            return if stop.load(Ordering::Relaxed) { Err(Failure::Stopped) } else { Ok(None) };
        };
        let tree = Tree::new(&graph, dissection);
        let arch = Arch::new();
        let panels = factor(&tree, &graph, arch, stop)?;
        Ok(Some(Self { tree, panels, arch }))
    }

    /// Solves for all columns, some at a time.
    pub(crate) fn solve(&self, rhs: &RightHandSides) -> Solution<'_> {
        let part = |first: usize| {
            let count = (rhs.columns - first).min(TOGETHER);
            let width = count.next_multiple_of(R::LINE);
            let mut values = Buffer::<R>::zeroed(rhs.size() * width);
            let given = Columns { rhs, first, count }.by_front(&self.tree);
            let active = activity::<R>(&self.tree, &given, Some((count, width)));
            let stacks = &mut Stacks::default();
            forward(&self.tree, &self.panels, self.arch, &given, &active, Some(width), &mut values, stacks);
            backward(&self.tree, &self.panels, self.arch, width, &mut values);
            Part { values: R::widen(values), width, count }
        };
        let parts = (0..rhs.columns).step_by(TOGETHER).map(part).collect();
        Solution { place: Some(&self.tree.place), parts, residual: 0.0 }
    }

    /// The fronts.
    pub(crate) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Number of stored entries of the factor.
    pub(crate) fn stored(&self) -> usize {
        self.panels.len()
    }
}

#[cfg(test)]
impl Multifrontal {
    /// Makes the factor wrong.
    pub(crate) fn spoil(&mut self, factor: f64) {
        self.panels.iter_mut().for_each(|value| *value *= factor);
    }
}

impl Multifrontal<f32> {
    /// Solves for rows that are mostly zero up to the `least` magnitude of each unknown; see [`sparse::solve`].
    pub(crate) fn solve_sparse<'f>(
        &'f self,
        rows: &Sum<'_, 'f>,
        least: &dyn Fn(usize) -> f64,
        work: &mut Workspace,
        stop: &AtomicBool,
    ) -> SparseRows<'f> {
        let least: Vec<f32> = self.tree.order.iter().map(|&unknown| least(unknown as usize) as f32).collect();
        sparse::solve((&self.tree, &self.panels, self.arch), rows, &least, work, stop)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::supernodal::Supernodal;

    /// A chain of unknowns, each coupled to its next thirty.
    pub(crate) fn chain(n: usize) -> (SymmetricMatrix, Vec<Vec3>) {
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

    /// Right-hand sides without a pattern.
    pub(crate) fn sines(n: usize, columns: usize) -> RightHandSides {
        RightHandSides::dense(n, columns, (0..n * columns).map(|i| (i as f64).sin()).collect())
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

    /// The largest error of solutions with a factor stored in `R`, made on `arch`.
    fn largest_error<R: Real>(arch: Arch) -> f64 {
        let (matrix, positions) = chain(1500);
        let rhs = sines(1500, 29);
        let oracle = Supernodal::factor(&matrix).unwrap();
        let wanted = oracle.solve(&rhs);
        let mut solver = Multifrontal::<R>::factor(&matrix, &positions, &crate::NEVER).unwrap().unwrap();
        solver.arch = arch;
        solver.panels = factor(&solver.tree, &Graph::new(&matrix), arch, &crate::NEVER).unwrap();
        let x = solver.solve(&rhs);
        let rows = (0..1500).flat_map(|i| x.row(i).zip(wanted.row(i)));
        rows.fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()))
    }

    #[test]
    fn solves_on_every_instruction_set() {
        for arch in instruction_sets() {
            let (single, double) = (largest_error::<f32>(arch), largest_error::<f64>(arch));
            assert!(single < 1e-4 && double < 1e-9, "{arch:?}: {single:e}, {double:e}");
            assert!(single > 1e-9, "{arch:?}: nothing was rounded");
        }
    }
}
