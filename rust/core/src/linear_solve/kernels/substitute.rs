//! Substitution with the blocks of a panel, right-hand sides side by side in the vectors.

use pulp::{Simd, WithSimd};

use super::super::blocks::BLOCK;
use super::{RowBlocks, divide, pivot_block, product};

/// Solves `triangle * y = y` in place for the triangle with these row blocks, `y` (columns, width).
pub(in super::super) struct Forward<'a> {
    pub(in super::super) rows: RowBlocks<'a>,
    pub(in super::super) y: &'a mut [f64],
    pub(in super::super) width: usize,
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, y, width } = self;
        let stride = width / S::F64_LANES;
        for (block, row) in rows.iter().enumerate() {
            let (before, pivots) = row.split_at(BLOCK * BLOCK * block);
            let (before, pivots) = (before.as_chunks().0, pivot_block(pivots));
            let (done, now) = y.split_at_mut(BLOCK * block * width);
            let done = S::as_simd_f64s(done).0;
            let now = S::as_mut_simd_f64s(&mut now[..(row.len() / BLOCK - BLOCK * block) * width]).0;
            let mut at = 0;
            while S::F64_LANES == BLOCK && at + 3 <= stride {
                forward_tile::<S, 3>(simd, done, now, stride, at, before, &pivots);
                at += 3;
            }
            while at < stride {
                forward_tile::<S, 1>(simd, done, now, stride, at, before, &pivots);
                at += 1;
            }
        }
    }
}

#[inline(always)]
fn forward_tile<S: Simd, const V: usize>(
    simd: S,
    done: &[S::f64s],
    now: &mut [S::f64s],
    stride: usize,
    at: usize,
    before: &[[f64; BLOCK]],
    pivots: &[f64; BLOCK * BLOCK],
) {
    let a: [&[S::f64s]; V] = std::array::from_fn(|v| &done[(at + v).min(done.len())..]);
    let sum = product::<S, V, BLOCK>(simd, a, stride, before, 0);
    let mut x = subtract_from::<S, V>(simd, now, stride, at, &sum);
    divide(simd, &mut x, pivots);
    store::<S, V>(now, stride, at, &x);
}

/// Up to eight rows of `target` minus `sum`; rows that are not there count as zero. (Indices are constants everywhere, or
/// the sums would live in memory instead of registers.)
#[inline(always)]
fn subtract_from<S: Simd, const V: usize>(
    simd: S,
    target: &[S::f64s],
    stride: usize,
    at: usize,
    sum: &[[S::f64s; BLOCK]; V],
) -> [[S::f64s; BLOCK]; V] {
    let mut x = [[simd.splat_f64s(0.0); BLOCK]; V];
    for c in 0..BLOCK {
        for v in 0..V {
            let old = target.get(c * stride + at + v).copied().unwrap_or(simd.splat_f64s(0.0));
            x[v][c] = simd.sub_f64s(old, sum[v][c]);
        }
    }
    x
}

/// Puts `x` into the rows of `target` that are there.
#[inline(always)]
fn store<S: Simd, const V: usize>(target: &mut [S::f64s], stride: usize, at: usize, x: &[[S::f64s; BLOCK]; V]) {
    for c in 0..BLOCK {
        for v in 0..V {
            if let Some(target) = target.get_mut(c * stride + at + v) {
                *target = x[v][c];
            }
        }
    }
}

/// Subtracts `rows[..][columns of y] * y` from `target` (8 per row block, width), or stores its negative.
pub(in super::super) struct Apply<'a> {
    pub(in super::super) rows: RowBlocks<'a>,
    pub(in super::super) y: &'a [f64],
    pub(in super::super) target: &'a mut [f64],
    pub(in super::super) width: usize,
    pub(in super::super) overwrite: bool,
}

impl WithSimd for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, y, target, width, overwrite } = self;
        let stride = width / S::F64_LANES;
        let depth = y.len() / width;
        let y = S::as_simd_f64s(y).0;
        for (row, target) in rows.iter().zip(target.chunks_mut(BLOCK * width)) {
            let row = row[..BLOCK * depth].as_chunks().0;
            let target = S::as_mut_simd_f64s(target).0;
            let mut at = 0;
            while at + 3 <= stride {
                apply_tile::<S, 3>(simd, y, target, stride, at, row, overwrite);
                at += 3;
            }
            while at < stride {
                apply_tile::<S, 1>(simd, y, target, stride, at, row, overwrite);
                at += 1;
            }
        }
    }
}

#[inline(always)]
fn apply_tile<S: Simd, const V: usize>(
    simd: S,
    y: &[S::f64s],
    target: &mut [S::f64s],
    stride: usize,
    at: usize,
    row: &[[f64; BLOCK]],
    overwrite: bool,
) {
    let a: [&[S::f64s]; V] = std::array::from_fn(|v| &y[(at + v).min(y.len())..]);
    if S::F64_LANES == BLOCK {
        let sum = product::<S, V, BLOCK>(simd, a, stride, row, 0);
        subtract_rows(simd, target, stride, at, 0, sum, overwrite);
    } else {
        for first in [0, 4] {
            let sum = product::<S, V, 4>(simd, a, stride, row, first);
            subtract_rows(simd, target, stride, at, first, sum, overwrite);
        }
    }
}

#[inline(always)]
fn subtract_rows<S: Simd, const V: usize, const C: usize>(
    simd: S,
    target: &mut [S::f64s],
    stride: usize,
    at: usize,
    first: usize,
    sum: [[S::f64s; C]; V],
    overwrite: bool,
) {
    for (c, row) in target.chunks_exact_mut(stride).skip(first).take(C).enumerate() {
        for v in 0..V {
            let old = if overwrite { simd.splat_f64s(0.0) } else { row[at + v] };
            row[at + v] = simd.sub_f64s(old, sum[v][c]);
        }
    }
}

/// Subtracts from the row block `y` (8 or fewer, width) the product of block column `block` of `rows`, transposed, with `x`;
/// then, given the pivots, solves `pivots^T * y = y`.
pub(in super::super) struct Backward<'a> {
    pub(in super::super) rows: RowBlocks<'a>,
    pub(in super::super) x: &'a [f64],
    pub(in super::super) block: usize,
    pub(in super::super) y: &'a mut [f64],
    pub(in super::super) width: usize,
    pub(in super::super) pivots: Option<&'a [f64]>,
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let stride = self.width / S::F64_LANES;
        let mut at = 0;
        let Self { rows, x, block, y, width: _, pivots } = self;
        let pivots = pivots.map(pivot_block);
        let (x, y) = (S::as_simd_f64s(x).0, S::as_mut_simd_f64s(y).0);
        while S::F64_LANES == BLOCK && at + 3 <= stride {
            backward_tile::<S, 3>(simd, rows, x, block, y, stride, at, pivots.as_ref());
            at += 3;
        }
        while at < stride {
            backward_tile::<S, 1>(simd, rows, x, block, y, stride, at, pivots.as_ref());
            at += 1;
        }
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn backward_tile<S: Simd, const V: usize>(
    simd: S,
    rows: RowBlocks,
    x: &[S::f64s],
    block: usize,
    y: &mut [S::f64s],
    stride: usize,
    at: usize,
    pivots: Option<&[f64; BLOCK * BLOCK]>,
) {
    let sum = transposed_product::<S, V>(simd, rows, x, block, y.len() / stride, stride, at);
    let mut sum = subtract_from::<S, V>(simd, y, stride, at, &sum);
    if let Some(pivots) = pivots {
        divide_transposed(simd, &mut sum, pivots);
    }
    store::<S, V>(y, stride, at, &sum);
}

/// Sums over i of `rows[i][block column c] * x[i][at + v]`, for the first `columns` columns of the block.
#[inline(always)]
fn transposed_product<S: Simd, const V: usize>(
    simd: S,
    rows: RowBlocks,
    x: &[S::f64s],
    block: usize,
    columns: usize,
    stride: usize,
    at: usize,
) -> [[S::f64s; BLOCK]; V] {
    let start = BLOCK * BLOCK * block;
    let mut sum = [[simd.splat_f64s(0.0); BLOCK]; V];
    for (row, x) in rows.iter().zip(x.chunks(BLOCK * stride)) {
        let stored = &row[start..start + BLOCK * columns];
        let padded;
        let entries: &[f64; BLOCK * BLOCK] = match stored.first_chunk() {
            Some(entries) => entries,
            None => {
                padded = pivot_block(stored);
                &padded
            }
        };
        for (r, x) in x.chunks_exact(stride).enumerate() {
            let x: [S::f64s; V] = std::array::from_fn(|v| x[at + v]);
            for c in 0..BLOCK {
                let factor = simd.splat_f64s(entries[BLOCK * c + (r % BLOCK)]);
                for v in 0..V {
                    sum[v][c] = simd.mul_add_e_f64s(x[v], factor, sum[v][c]);
                }
            }
        }
    }
    sum
}

/// Solves `pivots^T * x = x` for the rows x[v][0..8].
#[inline(always)]
fn divide_transposed<S: Simd, const V: usize>(simd: S, x: &mut [[S::f64s; BLOCK]; V], pivots: &[f64; BLOCK * BLOCK]) {
    for c in (0..BLOCK).rev() {
        let inverse = simd.splat_f64s(pivots[BLOCK * c + c]);
        for v in 0..V {
            x[v][c] = simd.mul_f64s(x[v][c], inverse);
        }
        for earlier in 0..c {
            let factor = simd.splat_f64s(-pivots[BLOCK * earlier + c]);
            for v in 0..V {
                x[v][earlier] = simd.mul_add_e_f64s(x[v][c], factor, x[v][earlier]);
            }
        }
    }
}
