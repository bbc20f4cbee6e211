//! Step 2: the unmatched vertices, block by block (paper sections 3.2 and 3.3).
//!
//! Energy Q = S + l^2 S M^-1 S with the matched rows as boundary values: `Q_UU W_U = -Q_UI W_I`. Unknowns that no chain
//! of two-rings connects never meet in Q_UU, so each such block has its own factorisation and only the bones that reach it.

use rayon::prelude::*;

use super::Source;
use super::system::{self, Boundary};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::surface::SurfacePoint;
use skinwright_solve::{Cholesky, RightHandSides, Solution, SymmetricMatrix};

/// Backward error above which a solution is refused.
const REFUSE_ABOVE: f64 = 1e-8;

/// The assembled system of a block of unknowns.
#[derive(Debug)]
pub struct System {
    unknowns: Vec<u32>,
    smoothness_length: f64,
    matrix: SymmetricMatrix,
    boundary: Boundary,
}

impl System {
    /// Assembles the block of `unknowns`; `number` is from [`number_unknowns`].
    pub fn new(laplacian: &Laplacian, unknowns: Vec<u32>, number: &[u32], smoothness_length: f64) -> Self {
        let (matrix, boundary) = system::assemble(laplacian, &unknowns, number, smoothness_length);
        Self { unknowns, smoothness_length, matrix, boundary }
    }
}

/// A factored block of unknowns. It depends on the mesh, on which vertices are unknown and on l; never on weights.
#[derive(Debug)]
pub struct Block {
    unknowns: Vec<u32>,
    smoothness_length: f64,
    boundary: Boundary,
    factor: Cholesky,
}

/// Raw weights of a block's unknowns, before any clamping.
#[derive(Debug)]
pub struct BlockWeights<'b> {
    bones: Vec<u32>,
    /// `None` if one bone alone reaches the block: weights sum to one, so it has weight one everywhere.
    solution: Option<Solution<'b>>,
}

impl BlockWeights<'_> {
    /// Bones and raw weights of the block's unknown `k`, by bone.
    pub fn row(&self, k: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let one = self.solution.is_none().then_some(1.0);
        let values = one.into_iter().chain(self.solution.iter().flat_map(move |solution| solution.row(k)));
        std::iter::zip(self.bones.iter().copied(), values)
    }

    /// Backward error of the solve.
    pub fn residual(&self) -> f64 {
        self.solution.as_ref().map_or(0.0, Solution::residual)
    }
}

impl Block {
    /// Factors an assembled block.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] with a vertex of the block.
    pub fn new(mesh: &TriMesh<'_>, system: System) -> Result<Self> {
        let System { unknowns, smoothness_length, matrix, boundary } = system;
        let positions: Vec<_> = unknowns.iter().map(|&i| mesh.positions()[i as usize].into()).collect();
        let factor = Cholesky::factor(matrix, &positions)
            .map_err(|e| Error::NotPositiveDefinite { vertex: unknowns[e.unknown] as usize })?;
        Ok(Self { unknowns, smoothness_length, boundary, factor })
    }

    /// The block's vertices, ascending.
    pub fn unknowns(&self) -> &[u32] {
        &self.unknowns
    }

    /// Whether this factorisation serves the block of `unknowns` at `smoothness_length`.
    pub fn serves(&self, unknowns: &[u32], smoothness_length: f64) -> bool {
        self.smoothness_length == smoothness_length && self.unknowns == unknowns
    }

    /// Raw weights of the unknowns, given the source and each vertex' closest `points` (V) on it.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the backward error stays above 1e-8.
    pub fn solve(&self, source: &Source, points: &[SurfacePoint]) -> Result<BlockWeights<'_>> {
        let rows: Vec<Vec<(u32, f64)>> =
            self.boundary.vertices.par_iter().map(|&i| blended(source, &points[i as usize])).collect();
        let mut bones: Vec<u32> = rows.iter().flatten().map(|&(bone, _)| bone).collect();
        bones.sort_unstable();
        bones.dedup();
        if bones.len() == 1 {
            return Ok(BlockWeights { bones, solution: None });
        }
        let solution = self.factor.solve(&self.right_hand_sides(&rows, &bones));
        if solution.residual().is_nan() || solution.residual() > REFUSE_ABOVE {
            return Err(Error::NotPositiveDefinite { vertex: self.unknowns[0] as usize });
        }
        Ok(BlockWeights { bones, solution: Some(solution) })
    }

    /// `-Q_UI W_I`, (unknowns, bones).
    fn right_hand_sides(&self, rows: &[Vec<(u32, f64)>], bones: &[u32]) -> RightHandSides {
        let mut column = vec![0u32; bones.last().map_or(0, |&bone| bone as usize + 1)];
        for (k, &bone) in bones.iter().enumerate() {
            column[bone as usize] = k as u32;
        }
        let entries = |u: u32| self.boundary.starts[u as usize]..self.boundary.starts[u as usize + 1];
        let band: Vec<u32> = (0..self.unknowns.len() as u32).filter(|&u| !entries(u).is_empty()).collect();
        let mut values = vec![0.0; band.len() * bones.len()];
        values.par_chunks_mut(bones.len().max(1)).zip(&band).with_min_len(256).for_each(|(row, &u)| {
            for at in entries(u) {
                for &(bone, weight) in &rows[self.boundary.columns[at] as usize] {
                    row[column[bone as usize] as usize] -= self.boundary.values[at] * weight;
                }
            }
        });
        RightHandSides::sparse(self.unknowns.len(), bones.len(), &band, values)
    }
}

fn blended(source: &Source, point: &SurfacePoint) -> Vec<(u32, f64)> {
    let mut row = Vec::new();
    source.blend(point, &mut row);
    row
}
