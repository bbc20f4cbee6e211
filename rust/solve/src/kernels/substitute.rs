//! Substitution with the blocks of a panel, right-hand sides side by side in the vectors.

use pulp::{Simd, WithSimd};

use super::{Real, RowBlocks, divide, eight_columns, pivot_block, product};
use crate::fronts::blocks::BLOCK;

/// What a kernel does to `V` neighbouring vectors of right-hand sides from `at` on, with sums for `C` rows at a time.
trait Strip {
    fn strip<const V: usize, const C: usize>(&mut self, at: usize);
}

/// Goes through a row of right-hand sides, `stride` vectors long, in strips as wide as the registers hold sums for.
#[inline(always)]
fn for_each_strip<S: Simd, R: Real>(stride: usize, mut kernel: impl Strip) {
    let mut at = 0;
    // A width is whole cache lines, so that no narrow vector is left alone.
    while R::lanes::<S>() < R::LINE && at < stride {
        kernel.strip::<2, 4>(at);
        at += 2;
    }
    while at < stride {
        at += match stride - at {
            1 => {
                kernel.strip::<1, BLOCK>(at);
                1
            }
            2 | 4 => {
                kernel.strip::<2, BLOCK>(at);
                2
            }
            _ => {
                kernel.strip::<3, BLOCK>(at);
                3
            }
        }
    }
}

/// Solves `triangle * y = y` in place for the triangle with these row blocks, `y` (columns, width).
pub(crate) struct Forward<'a, R> {
    pub(crate) rows: RowBlocks<'a, R>,
    pub(crate) y: &'a mut [R],
    pub(crate) width: usize,
}

impl<R: Real> WithSimd for Forward<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, y, width } = self;
        let stride = width / R::lanes::<S>();
        for (block, row) in rows.iter().enumerate() {
            let (before, pivots) = row.split_at(BLOCK * BLOCK * block);
            let (before, pivots) = (before.as_chunks().0, pivot_block(pivots));
            let (done, now) = y.split_at_mut(BLOCK * block * width);
            let done = R::vectors::<S>(done);
            let now = R::vectors_mut::<S>(&mut now[..(row.len() / BLOCK - BLOCK * block) * width]);
            for_each_strip::<S, R>(stride, ForwardStrip { simd, done, now, stride, before, pivots: &pivots });
        }
    }
}

struct ForwardStrip<'a, S: Simd, R: Real> {
    simd: S,
    done: &'a [R::Vector<S>],
    now: &'a mut [R::Vector<S>],
    stride: usize,
    before: &'a [[R; BLOCK]],
    pivots: &'a [R; BLOCK * BLOCK],
}

impl<S: Simd, R: Real> Strip for ForwardStrip<'_, S, R> {
    #[inline(always)]
    fn strip<const V: usize, const C: usize>(&mut self, at: usize) {
        let Self { simd, done, stride, before, pivots, .. } = *self;
        let done: [&[R::Vector<S>]; V] = std::array::from_fn(|v| &done[(at + v).min(done.len())..]);
        let sum = product::<S, R, V, C>(simd, done, stride, before);
        let mut x = subtract_from::<S, R, V>(simd, self.now, stride, at, &sum);
        divide::<S, R, V>(simd, &mut x, pivots);
        store::<S, R, V>(self.now, stride, at, &x);
    }
}

/// Up to eight rows of `target` minus `sum`; rows that are not there count as zero. (Indices are constants everywhere, or
/// the sums would live in memory instead of registers.)
#[inline(always)]
fn subtract_from<S: Simd, R: Real, const V: usize>(
    simd: S,
    target: &[R::Vector<S>],
    stride: usize,
    at: usize,
    sum: &[[R::Vector<S>; BLOCK]; V],
) -> [[R::Vector<S>; BLOCK]; V] {
    let mut x = [[R::splat(simd, R::ZERO); BLOCK]; V];
    for c in 0..BLOCK {
        for v in 0..V {
            let old = target.get(c * stride + at + v).copied().unwrap_or(R::splat(simd, R::ZERO));
            x[v][c] = R::sub(simd, old, sum[v][c]);
        }
    }
    x
}

/// Puts `x` into the rows of `target` that are there.
#[inline(always)]
fn store<S: Simd, R: Real, const V: usize>(
    target: &mut [R::Vector<S>],
    stride: usize,
    at: usize,
    x: &[[R::Vector<S>; BLOCK]; V],
) {
    for c in 0..BLOCK {
        for v in 0..V {
            if let Some(target) = target.get_mut(c * stride + at + v) {
                *target = x[v][c];
            }
        }
    }
}

/// Subtracts `rows[..][columns of y] * y` from `target` (8 per row block, width), or stores its negative.
pub(crate) struct Apply<'a, R> {
    pub(crate) rows: RowBlocks<'a, R>,
    pub(crate) y: &'a [R],
    pub(crate) target: &'a mut [R],
    pub(crate) width: usize,
    pub(crate) overwrite: bool,
}

impl<R: Real> WithSimd for Apply<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, y, target, width, overwrite } = self;
        let stride = width / R::lanes::<S>();
        let depth = y.len() / width;
        let y = R::vectors::<S>(y);
        for (row, target) in rows.iter().zip(target.chunks_mut(BLOCK * width)) {
            let row = row[..BLOCK * depth].as_chunks().0;
            let target = R::vectors_mut::<S>(target);
            for_each_strip::<S, R>(stride, ApplyStrip { simd, row, y, target, stride, overwrite });
        }
    }
}

struct ApplyStrip<'a, S: Simd, R: Real> {
    simd: S,
    row: &'a [[R; BLOCK]],
    y: &'a [R::Vector<S>],
    target: &'a mut [R::Vector<S>],
    stride: usize,
    overwrite: bool,
}

impl<S: Simd, R: Real> Strip for ApplyStrip<'_, S, R> {
    #[inline(always)]
    fn strip<const V: usize, const C: usize>(&mut self, at: usize) {
        let Self { simd, row, y, stride, overwrite, .. } = *self;
        let y: [&[R::Vector<S>]; V] = std::array::from_fn(|v| &y[(at + v).min(y.len())..]);
        let sum = product::<S, R, V, C>(simd, y, stride, row);
        let old = if overwrite { &[] } else { &*self.target };
        let x = subtract_from::<S, R, V>(simd, old, stride, at, &sum);
        store::<S, R, V>(self.target, stride, at, &x);
    }
}

/// Subtracts from the row block `y` (8 or fewer, width) the product of block column `block` of `rows`, transposed, with `x`;
/// then, given the pivots, solves `pivots^T * y = y`.
pub(crate) struct Backward<'a, R> {
    pub(crate) rows: RowBlocks<'a, R>,
    pub(crate) x: &'a [R],
    pub(crate) block: usize,
    pub(crate) y: &'a mut [R],
    pub(crate) width: usize,
    pub(crate) pivots: Option<&'a [R]>,
}

impl<R: Real> WithSimd for Backward<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { rows, x, block, y, width, pivots } = self;
        let pivots = pivots.map(pivot_block);
        let (x, y) = (R::vectors::<S>(x), R::vectors_mut::<S>(y));
        let stride = width / R::lanes::<S>();
        for_each_strip::<S, R>(stride, BackwardStrip { simd, rows, x, block, y, stride, pivots: pivots.as_ref() });
    }
}

struct BackwardStrip<'a, S: Simd, R: Real> {
    simd: S,
    rows: RowBlocks<'a, R>,
    x: &'a [R::Vector<S>],
    block: usize,
    y: &'a mut [R::Vector<S>],
    stride: usize,
    pivots: Option<&'a [R; BLOCK * BLOCK]>,
}

impl<S: Simd, R: Real> Strip for BackwardStrip<'_, S, R> {
    #[inline(always)]
    fn strip<const V: usize, const C: usize>(&mut self, at: usize) {
        let low = self.transposed_product::<V, C>(at, 0);
        let high = if C < BLOCK { self.transposed_product::<V, C>(at, C) } else { low };
        let sum = eight_columns(&low, &high);
        let mut x = subtract_from::<S, R, V>(self.simd, self.y, self.stride, at, &sum);
        if let Some(pivots) = self.pivots {
            divide_transposed::<S, R, V>(self.simd, &mut x, pivots);
        }
        store::<S, R, V>(self.y, self.stride, at, &x);
    }
}

impl<S: Simd, R: Real> BackwardStrip<'_, S, R> {
    /// Sums over i of `rows[i][block column first + c] * x[i][at + v]`; columns that are not there give zero.
    #[inline(always)]
    fn transposed_product<const V: usize, const C: usize>(&self, at: usize, first: usize) -> [[R::Vector<S>; C]; V] {
        let Self { simd, rows, x, block, stride, .. } = *self;
        let start = BLOCK * BLOCK * block;
        let columns = self.y.len() / stride;
        let mut sum = [[R::splat(simd, R::ZERO); C]; V];
        for (row, x) in rows.iter().zip(x.chunks(BLOCK * stride)) {
            let stored = &row[start..start + BLOCK * columns];
            let padded;
            let entries: &[R; BLOCK * BLOCK] = match stored.first_chunk() {
                Some(entries) => entries,
                None => {
                    padded = pivot_block(stored);
                    &padded
                }
            };
            for (r, x) in x.chunks_exact(stride).enumerate() {
                let x: [R::Vector<S>; V] = std::array::from_fn(|v| x[at + v]);
                for c in 0..C {
                    let factor = R::splat(simd, entries[BLOCK * (first + c) + (r % BLOCK)]);
                    for v in 0..V {
                        sum[v][c] = R::mul_add(simd, x[v], factor, sum[v][c]);
                    }
                }
            }
        }
        sum
    }
}

/// Solves `pivots^T * x = x` for the rows x[v][0..8].
#[inline(always)]
fn divide_transposed<S: Simd, R: Real, const V: usize>(
    simd: S,
    x: &mut [[R::Vector<S>; BLOCK]; V],
    pivots: &[R; BLOCK * BLOCK],
) {
    for c in (0..BLOCK).rev() {
        let inverse = R::splat(simd, pivots[BLOCK * c + c]);
        for v in 0..V {
            x[v][c] = R::mul(simd, x[v][c], inverse);
        }
        for earlier in 0..c {
            let factor = R::splat(simd, -pivots[BLOCK * earlier + c]);
            for v in 0..V {
                x[v][earlier] = R::mul_add(simd, x[v][c], factor, x[v][earlier]);
            }
        }
    }
}
