//! The solver for surfaces: nested dissection by coordinates and a multifrontal factor.

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
        let n = self.tree.order.len();
        let mut x = Buffer::zeroed(n * columns.min(TOGETHER).next_multiple_of(BLOCK));
        for first in (0..columns).step_by(TOGETHER) {
            let count = (columns - first).min(TOGETHER);
            let width = count.next_multiple_of(BLOCK);
            let x = &mut x[..n * width];
            self.solve(Columns { rhs, columns, first, count, width }, x);
            rhs.par_chunks_exact_mut(columns).with_min_len(512).enumerate().for_each(|(unknown, row)| {
                let place = self.tree.place[unknown] as usize * width;
                row[first..first + count].copy_from_slice(&x[place..place + count]);
            });
        }
    }

    fn solve(&self, columns: Columns, x: &mut [f64]) {
        solve(&self.tree, &self.panels, self.arch, columns, x);
    }

    /// Number of stored entries of the factor.
    pub(super) fn stored(&self) -> usize {
        self.panels.len()
    }
}
