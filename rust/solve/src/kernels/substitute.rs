//! Substitution with the blocks of a panel, right-hand sides side by side in the vectors.

use pulp::{Simd, WithSimd};

use super::{RowBlocks, divide, eight_columns, pivot_block, product};
use crate::fronts::blocks::BLOCK;

/// What a kernel does to `V` neighbouring vectors of right-hand sides from `at` on, with sums for `C` rows at a time.
trait Strip {
    fn strip<const V: usize, const C: usize>(&mut self, at: usize);
}

/// Goes through a row of right-hand sides, `stride` vectors long, in strips as wide as the registers hold sums for.
#[inline(always)]
fn for_each_strip<S: Simd>(stride: usize, mut kernel: impl Strip) {
    let mut at = 0;
    // A width is a multiple of eight, so that no narrow vector is left alone.
    while S::F64_LANES < BLOCK && at < stride {
        kernel.strip::<2, 4>(at);
        at += 2;
    }
    while at + 3 <= stride {
        kernel.strip::<3, BLOCK>(at);
        at += 3;
    }
    while at < stride {
        kernel.strip::<1, BLOCK>(at);
        at += 1;
    }
}

/// Solves `triangle * y = y` in place for the triangle with these row blocks, `y` (columns, width).
pub(crate) struct Forward<'a> {
    pub(crate) rows: RowBlocks<'a>,
    pub(crate) y: &'a mut [f64],
    pub(crate) width: usize,
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
            for_each_strip::<S>(stride, ForwardStrip { simd, done, now, stride, before, pivots: &pivots });
        }
    }
}

struct ForwardStrip<'a, S: Simd> {
    simd: S,
    done: &'a [S::f64s],
    now: &'a mut [S::f64s],
    stride: usize,
    before: &'a [[f64; BLOCK]],
    pivots: &'a [f64; BLOCK * BLOCK],
}

impl<S: Simd> Strip for ForwardStrip<'_, S> {
    #[inline(always)]
    fn strip<const V: usize, const C: usize>(&mut self, at: usize) {
        let Self { simd, done, stride, before, pivots, .. } = *self;
        let done: [&[S::f64s]; V] = std::array::from_fn(|v| &done[(at + v).min(done.len())..]);
        let sum = product::<S, V, C>(simd, done, stride, before);
        let mut x = subtract_from::<S, V>(simd, self.now, stride, at, &sum);
        divide(simd, &mut x, pivots);
        store::<S, V>(self.now, stride, at, &x);
    }
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
pub(crate) struct Apply<'a> {
    pub(crate) rows: RowBlocks<'a>,
    pub(crate) y: &'a [f64],
    pub(crate) target: &'a mut [f64],
    pub(crate) width: usize,
    pub(crate) overwrite: bool,
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
            for_each_strip::<S>(stride, ApplyStrip { simd, row, y, target, stride, overwrite });
        }
    }
}

struct ApplyStrip<'a, S: Simd> {
    simd: S,
    row: &'a [[f64; BLOCK]],
    y: &'a [S::f64s],
    target: &'a mut [S::f64s],
    stride: usize,
    overwrite: bool,
}

impl<S: Simd> Strip for ApplyStrip<'_, S> {
    #[inline(always)]
    fn strip<const V: usize, const C: usize>(&mut self, at: usize) {
        let Self { simd, row, y, stride, overwrite, .. } = *self;
        let y: [&[S::f64s]; V] = std::array::from_fn(|v| &y[(at + v).min(y.len())..]);
        let sum = product::<S, V, C>(simd, y, stride, row);
        let old = if overwrite { &[] } else { &*self.target };
        let x = subtract_from::<S, V>(simd, old, stride, at, &sum);
        store::<S, V>(self.target, stride, at, &x);
    }
}

/// Subtracts from the row block `y` (8 or fewer, width) the product of block column `block` of `rows`, transposed, with `x`;
/// then, given the pivots, solves `pivots^T * y = y`.
pub(crate) struct Backward<'a> {
    pub(crate) rows: RowBlocks<'a>,
    pub(crate) x: &'a [f64],
    pub(crate) block: usize,
    pub(crate) y: &'a mut [f64],
    pub(crate) width: usize,
    pub(crate) pivots: Option<&'a [f64]>,
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, x, block, y, width, pivots } = self;
        let pivots = pivots.map(pivot_block);
        let (x, y) = (S::as_simd_f64s(x).0, S::as_mut_simd_f64s(y).0);
        let stride = width / S::F64_LANES;
        for_each_strip::<S>(stride, BackwardStrip { simd, rows, x, block, y, stride, pivots: pivots.as_ref() });
    }
}

struct BackwardStrip<'a, S: Simd> {
    simd: S,
    rows: RowBlocks<'a>,
    x: &'a [S::f64s],
    block: usize,
    y: &'a mut [S::f64s],
    stride: usize,
    pivots: Option<&'a [f64; BLOCK * BLOCK]>,
}

impl<S: Simd> Strip for BackwardStrip<'_, S> {
    #[inline(always)]
    fn strip<const V: usize, const C: usize>(&mut self, at: usize) {
        let low = self.transposed_product::<V, C>(at, 0);
        let high = if C < BLOCK { self.transposed_product::<V, C>(at, C) } else { low };
        let sum = eight_columns(&low, &high);
        let mut x = subtract_from::<S, V>(self.simd, self.y, self.stride, at, &sum);
        if let Some(pivots) = self.pivots {
            divide_transposed(self.simd, &mut x, pivots);
        }
        store::<S, V>(self.y, self.stride, at, &x);
    }
}

impl<S: Simd> BackwardStrip<'_, S> {
    /// Sums over i of `rows[i][block column first + c] * x[i][at + v]`; columns that are not there give zero.
    #[inline(always)]
    fn transposed_product<const V: usize, const C: usize>(&self, at: usize, first: usize) -> [[S::f64s; C]; V] {
        let Self { simd, rows, x, block, stride, .. } = *self;
        let start = BLOCK * BLOCK * block;
        let columns = self.y.len() / stride;
        let mut sum = [[simd.splat_f64s(0.0); C]; V];
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
                for c in 0..C {
                    let factor = simd.splat_f64s(entries[BLOCK * (first + c) + (r % BLOCK)]);
                    for v in 0..V {
                        sum[v][c] = simd.mul_add_e_f64s(x[v], factor, sum[v][c]);
                    }
                }
            }
        }
        sum
    }
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
