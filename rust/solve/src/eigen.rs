//! The smallest eigenpairs of `S x = lambda M x`, S sparse, symmetric and positive semi-definite, M diagonal and positive.
//!
//! Block Lanczos on the shift-inverted operator `M^1/2 (S + sigma M)^-1 M^1/2`, whose largest eigenvalues belong to the
//! smallest wanted ones (Ericsson and Ruhe, The spectral transformation Lanczos method for the numerical solution of large
//! sparse generalized symmetric eigenvalue problems, Mathematics of Computation 35(152), 1980, doi:10.2307/2006390). Every
//! new block is orthogonalised twice against all earlier ones: a few hundred columns are kept anyway, and without ghosts
//! no selective scheme is needed. A block of eight finds the multiple eigenvalues of symmetric shapes.
//!
//! Small problems go to faer's dense solver. Sums run over runs of rows of fixed size, so the bits do not depend on threads.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};
use glam::Vec3;
use rayon::prelude::*;

use crate::{Cholesky, NotPositive, RightHandSides, SymmetricMatrix};

/// Columns of a block.
const BLOCK: usize = 8;
/// Rows that one product takes at a time.
const RUN: usize = 2048;
/// Residual of a Ritz pair, relative to its value, at which it counts as found.
const CONVERGED: f64 = 1e-9;
/// Problems up to this size are solved densely.
const DENSE: usize = 320;
/// Norm left of a column, relative to what it was, below which it is replaced by a fresh one.
const EXHAUSTED: f64 = 1e-10;

/// Eigenpairs in ascending order of their values.
#[derive(Debug, Clone, PartialEq)]
pub struct Eigenpairs {
    /// Eigenvalues, (count).
    pub values: Vec<f64>,
    /// Eigenvectors, (n, count) row-major, orthonormal with respect to M.
    pub vectors: Vec<f64>,
}

/// Why there are no eigenpairs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoEigenpairs {
    /// S is not positive semi-definite, or M not positive.
    NotPositive(NotPositive),
    /// The watch asked to stop.
    Stopped,
}

/// Finds the `count` smallest eigenpairs (fewer if there are fewer unknowns), those with eigenvalue zero included.
///
/// `stiffness` (n), `mass` (n), `positions` (n) guide the factorisation only. `watch` hears the share of the work that is
/// done, 0 to 1, and returns whether to go on.
///
/// # Errors
/// [`NoEigenpairs`].
pub fn smallest_eigenpairs(
    stiffness: &SymmetricMatrix,
    mass: &[f64],
    positions: &[Vec3],
    count: usize,
    watch: &dyn Fn(f64) -> bool,
) -> Result<Eigenpairs, NoEigenpairs> {
    let n = stiffness.size();
    let count = count.min(n);
    if let Some(unknown) = mass.iter().position(|&m| m.is_nan() || m <= 0.0) {
        return Err(NoEigenpairs::NotPositive(NotPositive { unknown }));
    }
    if n <= DENSE || 4 * count >= n {
        return if watch(0.0) { Ok(dense(stiffness, mass, count)) } else { Err(NoEigenpairs::Stopped) };
    }
    let operator = ShiftInverted::new(stiffness, mass, positions).map_err(NoEigenpairs::NotPositive)?;
    let mut lanczos = Lanczos::start(&operator);
    loop {
        // At most 4 count + 160 columns; mostly it takes two and a half times the wanted ones.
        if !watch((lanczos.width() as f64 / (3 * count + 4 * BLOCK) as f64).min(0.95)) {
            return Err(NoEigenpairs::Stopped);
        }
        lanczos.step();
        let full = lanczos.width() >= (4 * count + 20 * BLOCK).min(n - BLOCK);
        if full || (lanczos.width() >= 2 * count + BLOCK && lanczos.blocks.len().is_multiple_of(4)) {
            let ritz = lanczos.ritz(count);
            if full || ritz.converged {
                return Ok(operator.eigenpairs(&lanczos, &ritz));
            }
        }
    }
}

/// `M^-1/2 S M^-1/2` as a dense matrix, all of its eigenpairs by faer.
fn dense(stiffness: &SymmetricMatrix, mass: &[f64], count: usize) -> Eigenpairs {
    let n = stiffness.size();
    let mut matrix = Mat::<f64>::zeros(n, n);
    for j in 0..n {
        for at in stiffness.column_starts[j]..stiffness.column_starts[j + 1] {
            let i = stiffness.rows[at] as usize;
            matrix[(i, j)] = stiffness.values[at] / (mass[i] * mass[j]).sqrt();
        }
    }
    let eigen = matrix.self_adjoint_eigen(Side::Lower).expect("the QR algorithm converges on finite entries");
    let values = (0..count).map(|k| eigen.S()[k].max(0.0)).collect();
    let mut vectors = vec![0.0; n * count];
    for (i, row) in vectors.chunks_exact_mut(count.max(1)).enumerate() {
        row.iter_mut().enumerate().for_each(|(k, x)| *x = eigen.U()[(i, k)] / mass[i].sqrt());
    }
    with_signs(Eigenpairs { values, vectors })
}

/// Makes the largest entry of each vector positive.
fn with_signs(mut pairs: Eigenpairs) -> Eigenpairs {
    let count = pairs.values.len();
    let mut largest = vec![0.0f64; count];
    for row in pairs.vectors.chunks_exact(count.max(1)) {
        for (most, &x) in largest.iter_mut().zip(row) {
            // Entries of equal size but for rounding: the first counts.
            if x.abs() > most.abs() * (1.0 + 1e-6) {
                *most = x;
            }
        }
    }
    for row in pairs.vectors.chunks_exact_mut(count.max(1)) {
        row.iter_mut().zip(&largest).for_each(|(x, most)| *x *= most.signum());
    }
    pairs
}

/// `M^1/2 (S + sigma M)^-1 M^1/2`, sigma one over the total mass: of the size of the first eigenvalue of a surface.
struct ShiftInverted {
    factor: Cholesky,
    root_mass: Vec<f64>,
    sigma: f64,
}

impl ShiftInverted {
    fn new(stiffness: &SymmetricMatrix, mass: &[f64], positions: &[Vec3]) -> Result<Self, NotPositive> {
        let sigma = shift(stiffness, mass);
        let mut matrix = stiffness.clone();
        for (j, &m) in mass.iter().enumerate() {
            matrix.values[matrix.column_starts[j]] += sigma * m;
        }
        let factor = Cholesky::factor(matrix, positions)?;
        Ok(Self { factor, root_mass: mass.iter().map(|m| m.sqrt()).collect(), sigma })
    }

    fn size(&self) -> usize {
        self.root_mass.len()
    }

    /// The operator times a block (n, BLOCK).
    fn apply(&self, block: &[f64]) -> Vec<f64> {
        let scaled = |(row, root): (&[f64], &f64)| -> [f64; BLOCK] { std::array::from_fn(|c| row[c] * root) };
        let rhs: Vec<[f64; BLOCK]> = block.par_chunks_exact(BLOCK).zip(&self.root_mass).map(scaled).collect();
        let solution = self.factor.solve(&RightHandSides::dense(self.size(), BLOCK, rhs.into_flattened()));
        let mut product = vec![0.0; block.len()];
        product.par_chunks_exact_mut(BLOCK).zip(&self.root_mass).enumerate().for_each(|(i, (row, root))| {
            row.iter_mut().zip(solution.row(i)).for_each(|(x, y)| *x = root * y);
        });
        product
    }

    /// Back to the eigenpairs of (S, M): `lambda = 1 / theta - sigma`, `x = M^-1/2 V y`.
    fn eigenpairs(&self, lanczos: &Lanczos<'_>, ritz: &Ritz) -> Eigenpairs {
        let count = ritz.values.len();
        let mut vectors = vec![0.0; self.size() * count];
        vectors.par_chunks_mut(RUN * count).enumerate().for_each(|(run, out)| {
            let rows = out.len() / count;
            let mut sum = MatMut::from_row_major_slice_mut(out, rows, count);
            for (b, block) in lanczos.blocks.iter().enumerate() {
                let part = rows_of(block, run, rows);
                let y = ritz.vectors.get(b * BLOCK..(b + 1) * BLOCK, ..);
                let accum = if b == 0 { Accum::Replace } else { Accum::Add };
                matmul(sum.as_mut(), accum, part, y, 1.0, Par::Seq);
            }
        });
        vectors.par_chunks_exact_mut(count).zip(&self.root_mass).for_each(|(row, root)| {
            row.iter_mut().for_each(|x| *x /= root);
        });
        let values = ritz.values.iter().map(|theta| (1.0 / theta - self.sigma).max(0.0)).collect();
        with_signs(Eigenpairs { values, vectors })
    }
}

/// One over the total mass in units of S, so that scaling S or M scales the shift with the eigenvalues.
fn shift(stiffness: &SymmetricMatrix, mass: &[f64]) -> f64 {
    let total: f64 = mass.iter().sum();
    let mean_diagonal = (0..mass.len()).map(|i| stiffness.diagonal(i)).sum::<f64>() / mass.len() as f64;
    let stiff = if mean_diagonal > 0.0 { mean_diagonal } else { 1.0 };
    0.25 * stiff / total
}

fn rows_of(block: &[f64], run: usize, rows: usize) -> MatRef<'_, f64> {
    MatRef::from_row_major_slice(&block[run * RUN * BLOCK..][..rows * BLOCK], rows, BLOCK)
}

/// An orthonormal basis in blocks (n, BLOCK) row-major and the operator projected onto it.
struct Lanczos<'a> {
    operator: &'a ShiftInverted,
    blocks: Vec<Vec<f64>>,
    /// The block after the last one, orthonormal to all.
    next: Vec<f64>,
    /// Coupling of the last block with `next`, (BLOCK, BLOCK).
    coupling: Mat<f64>,
    /// `V_i' A V_j` of the blocks i <= j, by j.
    projected: Vec<Vec<Mat<f64>>>,
}

/// The wanted pairs of the projected operator, the largest values first.
struct Ritz {
    values: Vec<f64>,
    /// (width, count).
    vectors: Mat<f64>,
    converged: bool,
}

impl<'a> Lanczos<'a> {
    fn start(operator: &'a ShiftInverted) -> Self {
        let n = operator.size();
        let mut next: Vec<f64> = (0..n * BLOCK).map(|k| noise(k as u64)).collect();
        orthonormalise(&[], &mut next);
        Self { operator, blocks: Vec::new(), next, coupling: Mat::zeros(BLOCK, BLOCK), projected: Vec::new() }
    }

    fn width(&self) -> usize {
        self.blocks.len() * BLOCK
    }

    fn step(&mut self) {
        self.blocks.push(std::mem::take(&mut self.next));
        let mut next = self.operator.apply(self.blocks.last().expect("just pushed"));
        let mut column: Vec<Mat<f64>> = Vec::new();
        for pass in 0..2 {
            for (i, block) in self.blocks.iter().enumerate() {
                let product = transposed_product(block, &next);
                subtract(&mut next, block, &product);
                if pass == 0 { column.push(product) } else { column[i] += product }
            }
        }
        self.coupling = orthonormalise(&self.blocks, &mut next);
        self.next = next;
        self.projected.push(column);
    }

    fn ritz(&self, count: usize) -> Ritz {
        let width = self.width();
        let mut matrix = Mat::<f64>::zeros(width, width);
        for (j, column) in self.projected.iter().enumerate() {
            for (i, part) in column.iter().enumerate() {
                for (a, b) in (0..BLOCK).flat_map(|a| (0..BLOCK).map(move |b| (a, b))) {
                    matrix[(j * BLOCK + b, i * BLOCK + a)] = part[(a, b)];
                }
            }
        }
        let eigen = matrix.self_adjoint_eigen(Side::Lower).expect("the QR algorithm converges on finite entries");
        let values: Vec<f64> = (0..count).map(|k| eigen.S()[width - 1 - k]).collect();
        let vectors = Mat::from_fn(width, count, |i, k| eigen.U()[(i, width - 1 - k)]);
        let residuals = &self.coupling * vectors.get(width - BLOCK.., ..);
        let converged = (0..count).all(|k| residuals.col(k).norm_l2() <= CONVERGED * values[k]);
        Ritz { values, vectors, converged }
    }
}

/// `V' W` of two blocks, (BLOCK, BLOCK).
fn transposed_product(v: &[f64], w: &[f64]) -> Mat<f64> {
    let product = |run: usize| {
        let rows = (v.len() / BLOCK - run * RUN).min(RUN);
        rows_of(v, run, rows).transpose() * rows_of(w, run, rows)
    };
    let parts: Vec<Mat<f64>> = (0..(v.len() / BLOCK).div_ceil(RUN)).into_par_iter().map(product).collect();
    parts.into_iter().fold(Mat::zeros(BLOCK, BLOCK), |sum, part| sum + part)
}

/// `W -= V H`.
fn subtract(w: &mut [f64], v: &[f64], h: &Mat<f64>) {
    w.par_chunks_mut(RUN * BLOCK).enumerate().for_each(|(run, part)| {
        let rows = part.len() / BLOCK;
        let part = MatMut::from_row_major_slice_mut(part, rows, BLOCK);
        matmul(part, Accum::Add, rows_of(v, run, rows), h, -1.0, Par::Seq);
    });
}

/// Orthonormalises the columns of a block that is orthogonal to `blocks` by Gram-Schmidt, twice per column; returns R with
/// `before = after R`. A column that has nothing left is replaced by noise that is orthogonal to all, with zeros in R.
fn orthonormalise(blocks: &[Vec<f64>], block: &mut [f64]) -> Mat<f64> {
    let mut r = Mat::<f64>::zeros(BLOCK, BLOCK);
    for c in 0..BLOCK {
        let before = column_norm(block, c);
        remove_earlier_columns(block, c, Some(&mut r));
        let mut norm = column_norm(block, c);
        if norm > EXHAUSTED * before && norm > 0.0 {
            r[(c, c)] = norm;
        } else {
            norm = replace_column(blocks, block, c);
            (0..c).for_each(|p| r[(p, c)] = 0.0);
        }
        block.iter_mut().skip(c).step_by(BLOCK).for_each(|x| *x /= norm);
    }
    r
}

fn column_norm(block: &[f64], c: usize) -> f64 {
    block.chunks_exact(BLOCK).map(|row| row[c] * row[c]).sum::<f64>().sqrt()
}

fn remove_earlier_columns(block: &mut [f64], c: usize, mut r: Option<&mut Mat<f64>>) {
    for _ in 0..2 {
        for p in 0..c {
            let dot: f64 = block.chunks_exact(BLOCK).map(|row| row[p] * row[c]).sum();
            block.chunks_exact_mut(BLOCK).for_each(|row| row[c] -= dot * row[p]);
            if let Some(r) = r.as_deref_mut() {
                r[(p, c)] += dot;
            }
        }
    }
}

fn replace_column(blocks: &[Vec<f64>], block: &mut [f64], c: usize) -> f64 {
    let seed = ((blocks.len() + 1) * BLOCK + c) as u64 * block.len() as u64;
    block.chunks_exact_mut(BLOCK).enumerate().for_each(|(i, row)| row[c] = noise(seed + i as u64));
    for earlier in blocks.iter().chain(blocks) {
        for p in 0..BLOCK {
            let rows = earlier.chunks_exact(BLOCK).zip(block.chunks_exact(BLOCK));
            let dot: f64 = rows.map(|(e, row)| e[p] * row[c]).sum();
            block.chunks_exact_mut(BLOCK).zip(earlier.chunks_exact(BLOCK)).for_each(|(row, e)| row[c] -= dot * e[p]);
        }
    }
    remove_earlier_columns(block, c, None);
    column_norm(block, c)
}

/// A number in [-1, 1), the same everywhere (splitmix64).
fn noise(k: u64) -> f64 {
    let mut x = k.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
