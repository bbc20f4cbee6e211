//! Step 2: the unmatched vertices, block by block (paper sections 3.2 and 3.3).
//!
//! Energy Q = S + l^2 S M^-1 S with the matched rows as boundary values: `Q_UU W_U = -Q_UI W_I`. Unknowns that no chain
//! of two-rings connects never meet in Q_UU, so each such block has its own factorisation and only the bones that reach it.

use rayon::prelude::*;

use super::Source;
use super::system::{self, Boundary};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::linear_solve::{Cholesky, SymmetricMatrix};
use crate::mesh::TriMesh;
use crate::surface::SurfacePoint;

/// Backward error above which a solution is refined once, and above which it is refused.
const REFINE_ABOVE: f64 = 1e-14;
const REFUSE_ABOVE: f64 = 1e-8;

/// A factored block of unknowns. It depends on the mesh, on which vertices are unknown and on l; never on weights.
#[derive(Debug)]
pub struct Block {
    unknowns: Vec<u32>,
    smoothness_length: f64,
    matrix: SymmetricMatrix,
    boundary: Boundary,
    factor: Cholesky,
}

/// Raw weights of a block's unknowns: `values` is (unknowns, bones), row-major, before any clamping.
#[derive(Debug)]
pub struct BlockWeights {
    /// Bones that reach the block, ascending.
    pub bones: Vec<u32>,
    /// Raw weights.
    pub values: Vec<f64>,
    /// Backward error of the solve (see [`Block::solve`]).
    pub residual: f64,
}

impl Block {
    /// Assembles and factors the block of `unknowns`; `number` is from [`number_unknowns`].
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] with a vertex of the block.
    pub fn new(
        mesh: &TriMesh<'_>,
        laplacian: &Laplacian,
        unknowns: Vec<u32>,
        number: &[u32],
        smoothness_length: f64,
    ) -> Result<Self> {
        let (matrix, boundary) = system::assemble(laplacian, &unknowns, number, smoothness_length);
        let positions: Vec<_> = unknowns.iter().map(|&i| mesh.positions()[i as usize].into()).collect();
        let factor = Cholesky::factor(&matrix, &positions)
            .map_err(|e| Error::NotPositiveDefinite { vertex: unknowns[e.unknown] as usize })?;
        Ok(Self { unknowns, smoothness_length, matrix, boundary, factor })
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
    /// The residual is the normwise backward error `|r| / (|Q| |x| + |b|)` (maximum norms) of one pseudo-random combination of the
    /// columns: it costs one product and sees an error in any column.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the residual stays above 1e-8 after refinement.
    pub fn solve(&self, source: &Source, points: &[SurfacePoint]) -> Result<BlockWeights> {
        let rows: Vec<Vec<(u32, f64)>> =
            self.boundary.vertices.par_iter().map(|&i| blended(source, &points[i as usize])).collect();
        let mut bones: Vec<u32> = rows.iter().flatten().map(|&(bone, _)| bone).collect();
        bones.sort_unstable();
        bones.dedup();
        if bones.len() == 1 {
            // The weights sum to one everywhere, so a single bone has weight one everywhere.
            return Ok(BlockWeights { bones, values: vec![1.0; self.unknowns.len()], residual: 0.0 });
        }
        let rhs = self.right_hand_sides(&rows, &bones);
        let mut values = rhs.clone();
        self.factor.solve_in_place(&mut values, bones.len());
        let mut residual = self.residual(&values, &rhs, bones.len());
        if residual > REFINE_ABOVE {
            self.refine(&mut values, &rhs, bones.len());
            residual = self.residual(&values, &rhs, bones.len());
        }
        if residual.is_nan() || residual > REFUSE_ABOVE {
            return Err(Error::NotPositiveDefinite { vertex: self.unknowns[0] as usize });
        }
        Ok(BlockWeights { bones, values, residual })
    }

    /// `-Q_UI W_I`, (unknowns, bones) row-major.
    fn right_hand_sides(&self, rows: &[Vec<(u32, f64)>], bones: &[u32]) -> Vec<f64> {
        let mut column = vec![0u32; bones.last().map_or(0, |&bone| bone as usize + 1)];
        for (k, &bone) in bones.iter().enumerate() {
            column[bone as usize] = k as u32;
        }
        let mut rhs = vec![0.0; self.unknowns.len() * bones.len()];
        rhs.par_chunks_mut(bones.len()).with_min_len(256).enumerate().for_each(|(u, row)| {
            for at in self.boundary.starts[u]..self.boundary.starts[u + 1] {
                for &(bone, weight) in &rows[self.boundary.columns[at] as usize] {
                    row[column[bone as usize] as usize] -= self.boundary.values[at] * weight;
                }
            }
        });
        rhs
    }

    fn residual(&self, x: &[f64], b: &[f64], columns: usize) -> f64 {
        let signs: Vec<f64> =
            (0..columns as u32).map(|k| if (k * 0x9E37 + 0x79B9) & 0x40 == 0 { 1.0 } else { -0.6 }).collect();
        let combine = |rows: &[f64]| -> Vec<f64> {
            let dot = |row: &[f64]| std::iter::zip(row, &signs).map(|(a, b)| a * b).sum();
            rows.par_chunks(columns).with_min_len(256).map(dot).collect()
        };
        let (x, b) = (combine(x), combine(b));
        let mut r = b.clone();
        let mut absolute_row_sums = vec![0.0; r.len()];
        for_each_entry(&self.matrix, |i, j, value| {
            r[i] -= value * x[j];
            absolute_row_sums[i] += value.abs();
        });
        let norm = |v: &[f64]| v.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let scale = norm(&absolute_row_sums) * norm(&x) + norm(&b);
        if r.iter().any(|x| x.is_nan()) {
            f64::NAN
        } else if scale == 0.0 {
            0.0
        } else {
            norm(&r) / scale
        }
    }

    /// One step of iterative refinement.
    fn refine(&self, x: &mut [f64], b: &[f64], columns: usize) {
        let mut correction = b.to_vec();
        for_each_entry(&self.matrix, |i, j, value| {
            for k in 0..columns {
                correction[i * columns + k] -= value * x[j * columns + k];
            }
        });
        self.factor.solve_in_place(&mut correction, columns);
        for (x, dx) in std::iter::zip(x, correction) {
            *x += dx;
        }
    }
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

fn blended(source: &Source, point: &SurfacePoint) -> Vec<(u32, f64)> {
    let mut row = Vec::new();
    source.blend(point, &mut row);
    row
}
