//! Dense arithmetic on row blocks (see `blocks`), compiled for AVX-512, AVX2 with FMA and plain code, chosen at run time.
//!
//! Everything is a sum of products of eight-wide streams held in registers: with 32 registers 24 vectors at a time, else 8.
//! Each sum runs in one fixed order, so how rows are shared out among threads never shows in the bits.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::blocks::BLOCK;

/// Columns that a product sums up before it stores, and row blocks it keeps at hand meanwhile: half a megabyte.
const DEPTH: usize = 256;
const BREADTH: usize = 32;

/// Sums over p of `a[v][p * stride] * b[p][first + c]`.
#[inline(always)]
fn product<S: Simd, const V: usize, const C: usize>(
    simd: S,
    a: [&[S::f64s]; V],
    stride: usize,
    b: &[[f64; BLOCK]],
    first: usize,
) -> [[S::f64s; C]; V] {
    let mut sum = [[simd.splat_f64s(0.0); C]; V];
    for (p, b) in b.iter().enumerate() {
        let b: &[f64; C] = b[first..].first_chunk().expect("first is 0, or 4 with C = 4");
        let a: [S::f64s; V] = std::array::from_fn(|v| a[v][p * stride]);
        for c in 0..C {
            let factor = simd.splat_f64s(b[c]);
            for v in 0..V {
                sum[v][c] = simd.mul_add_e_f64s(a[v], factor, sum[v][c]);
            }
        }
    }
    sum
}

/// A block of a panel's triangle on the diagonal, padded to eight columns; pivots are stored inverted.
fn pivot_block(stored: &[f64]) -> [f64; BLOCK * BLOCK] {
    let mut block = [0.0; BLOCK * BLOCK];
    block[..stored.len()].copy_from_slice(stored);
    block
}

/// Solves `x * pivots^T = x` for the columns x[v][0..8].
#[inline(always)]
fn divide<S: Simd, const V: usize>(simd: S, x: &mut [[S::f64s; BLOCK]; V], pivots: &[f64; BLOCK * BLOCK]) {
    for c in 0..BLOCK {
        let inverse = simd.splat_f64s(pivots[BLOCK * c + c]);
        for v in 0..V {
            x[v][c] = simd.mul_f64s(x[v][c], inverse);
        }
        for later in c + 1..BLOCK {
            let factor = simd.splat_f64s(-pivots[BLOCK * c + later]);
            for v in 0..V {
                x[v][later] = simd.mul_add_e_f64s(x[v][c], factor, x[v][later]);
            }
        }
    }
}

/// Factors the block columns `first..last` of the row blocks `rows` of a panel, earlier ones being subtracted already.
/// `pivots` are the panel's row blocks before them, complete up to `last`.
pub(super) struct Eliminate<'a, 'p, 'r> {
    pub(super) pivots: &'a [&'p mut [f64]],
    pub(super) rows: &'a mut [&'r mut [f64]],
    pub(super) first: usize,
    pub(super) last: usize,
    pub(super) columns: usize,
}

impl WithSimd for Eliminate<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { pivots, rows, first, last, columns } = self;
        let skip = BLOCK * BLOCK * first;
        let tile = |rows: &mut [&mut [f64]]| {
            for (block, pivot_row) in pivots.iter().enumerate().take(last).skip(first) {
                let start = BLOCK * BLOCK * block;
                let width = BLOCK.min(columns - BLOCK * block);
                let pivot = pivot_block(&pivot_row[start..start + BLOCK * width]);
                let before = pivot_row[BLOCK * BLOCK * first..start].as_chunks().0;
                match rows {
                    [r0, r1, r2] if S::F64_LANES == BLOCK => {
                        eliminate_tile::<S, 3>(
                            simd,
                            [r0, r1, r2].map(|row| &mut row[skip..]),
                            0,
                            before,
                            &pivot,
                            width,
                        );
                    }
                    _ => {
                        for row in rows.iter_mut() {
                            for part in 0..(BLOCK / S::F64_LANES) {
                                eliminate_tile::<S, 1>(simd, [&mut row[skip..]], part, before, &pivot, width);
                            }
                        }
                    }
                }
            }
        };
        rows.chunks_mut(3).for_each(tile);
    }
}

#[inline(always)]
fn eliminate_tile<S: Simd, const V: usize>(
    simd: S,
    rows: [&mut [f64]; V],
    part: usize,
    before: &[[f64; BLOCK]],
    pivots: &[f64; BLOCK * BLOCK],
    width: usize,
) {
    let stride = BLOCK / S::F64_LANES;
    let start = BLOCK * before.len();
    let mut done: [&[S::f64s]; V] = [&[]; V];
    let mut now: [&mut [S::f64s]; V] = std::array::from_fn(|_| &mut [][..]);
    for (v, row) in rows.into_iter().enumerate() {
        let (left, right) = row.split_at_mut(start);
        done[v] = &S::as_simd_f64s(left).0[part.min(left.len())..];
        now[v] = &mut S::as_mut_simd_f64s(&mut right[..BLOCK * width]).0[part..];
    }
    let sum = product::<S, V, BLOCK>(simd, done, stride, before, 0);
    let mut x = [[simd.splat_f64s(0.0); BLOCK]; V];
    for v in 0..V {
        for c in 0..BLOCK {
            let old = if c < width { now[v][c * stride] } else { simd.splat_f64s(0.0) };
            x[v][c] = simd.sub_f64s(old, sum[v][c]);
        }
    }
    divide(simd, &mut x, pivots);
    for v in 0..V {
        for c in 0..BLOCK {
            if c < width {
                now[v][c * stride] = x[v][c];
            }
        }
    }
}

/// Factors the block on the diagonal at the end of `row`, its other columns being complete. A pivot must exceed its floor.
pub(super) struct Pivot<'a> {
    pub(super) row: &'a mut [f64],
    pub(super) floors: &'a [f64],
}

impl WithSimd for Pivot<'_> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let width = self.floors.len();
        let (done, now) = self.row.split_at_mut(self.row.len() - BLOCK * width);
        let stride = BLOCK / S::F64_LANES;
        let mut block = pivot_block(now);
        for part in 0..stride {
            let vectors = &S::as_simd_f64s(done).0[part.min(done.len())..];
            let [sum] = product::<S, 1, BLOCK>(simd, [vectors], stride, done.as_chunks().0, 0);
            let block = S::as_mut_simd_f64s(&mut block).0;
            for c in 0..BLOCK {
                block[c * stride + part] = simd.sub_f64s(block[c * stride + part], sum[c]);
            }
        }
        for c in 0..width {
            let pivot = block[BLOCK * c + c];
            if pivot.is_nan() || pivot <= self.floors[c] {
                return Err(c);
            }
            let inverse = 1.0 / pivot.sqrt();
            block[BLOCK * c..BLOCK * c + BLOCK].iter_mut().for_each(|value| *value *= inverse);
            block[BLOCK * c + c] = inverse;
            for later in c + 1..BLOCK {
                let factor = block[BLOCK * c + later];
                for r in later..BLOCK {
                    block[BLOCK * later + r] -= block[BLOCK * c + r] * factor;
                }
            }
        }
        now.copy_from_slice(&block[..now.len()]);
        Ok(())
    }
}

/// Subtracts from (or overwrites with the negative of) a trapezoid of blocks the product of row blocks `a` with `b`,
/// transposed: block column j of `target[i]` gets `a[i] * b[j]^T` for every j up to `first + i`.
pub(super) struct Product<'a, 't> {
    pub(super) a: RowBlocks<'a>,
    pub(super) b: RowBlocks<'a>,
    pub(super) target: &'a mut [&'t mut [f64]],
    pub(super) first: usize,
    pub(super) overwrite: bool,
}

impl WithSimd for Product<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { a, b, target, first, overwrite } = self;
        let len = b.first().map_or(0, |b| b.len());
        for start in (0..len).step_by(BLOCK * DEPTH) {
            let depth = start..len.min(start + BLOCK * DEPTH);
            let overwrite = overwrite && start == 0;
            for (j, b) in b.chunks(BREADTH).enumerate() {
                for (i, (a, target)) in a.chunks(3).zip(target.chunks_mut(3)).enumerate() {
                    trapezoid(simd, a, b, target, first + 3 * i, BREADTH * j, depth.clone(), overwrite);
                }
            }
        }
    }
}

/// The part of a product in up to three row blocks from `row` on and in the block columns from `column` on.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn trapezoid<S: Simd>(
    simd: S,
    a: RowBlocks,
    b: RowBlocks,
    target: &mut [&mut [f64]],
    row: usize,
    column: usize,
    depth: Range<usize>,
    overwrite: bool,
) {
    for (j, b) in b.iter().enumerate() {
        let (b, column) = (b[depth.clone()].as_chunks().0, column + j);
        match (a, &mut *target) {
            ([a0, a1, a2], [t0, t1, t2]) if S::F64_LANES == BLOCK && column <= row => {
                let a = [a0, a1, a2].map(|a| S::as_simd_f64s(&a[depth.clone()]).0);
                let sum = product::<S, 3, BLOCK>(simd, a, 1, b, 0);
                subtract(simd, block_mut(t0, column), 0, 0, &sum[0], overwrite);
                subtract(simd, block_mut(t1, column), 0, 0, &sum[1], overwrite);
                subtract(simd, block_mut(t2, column), 0, 0, &sum[2], overwrite);
            }
            (a, target) => {
                for (i, (a, target)) in a.iter().zip(target).enumerate() {
                    if column <= row + i {
                        subtract_block(simd, block_mut(target, column), &a[depth.clone()], b, overwrite);
                    }
                }
            }
        }
    }
}

/// A block of a row block; the last one of a panel may be narrow.
fn block_mut<'r>(row: &'r mut [f64], column: usize) -> &'r mut [f64] {
    let row = &mut row[BLOCK * BLOCK * column..];
    let len = row.len().min(BLOCK * BLOCK);
    &mut row[..len]
}

#[inline(always)]
fn subtract_block<S: Simd>(simd: S, target: &mut [f64], a: &[f64], b: &[[f64; BLOCK]], overwrite: bool) {
    let stride = BLOCK / S::F64_LANES;
    let a = S::as_simd_f64s(a).0;
    for part in 0..stride {
        let a = &a[part.min(a.len())..];
        if S::F64_LANES == BLOCK {
            let [sum] = product::<S, 1, BLOCK>(simd, [a], stride, b, 0);
            subtract(simd, target, part, 0, &sum, overwrite);
        } else {
            for first in [0, 4] {
                let [sum] = product::<S, 1, 4>(simd, [a], stride, b, first);
                subtract(simd, target, part, first, &sum, overwrite);
            }
        }
    }
}

/// Subtracts `sum` from, or stores its negative into, the columns `first..` of a block.
#[inline(always)]
fn subtract<S: Simd, const C: usize>(
    simd: S,
    block: &mut [f64],
    part: usize,
    first: usize,
    sum: &[S::f64s; C],
    overwrite: bool,
) {
    let stride = BLOCK / S::F64_LANES;
    let block = S::as_mut_simd_f64s(block).0;
    for c in 0..C {
        if let Some(target) = block.get_mut((first + c) * stride + part) {
            *target = simd.sub_f64s(if overwrite { simd.splat_f64s(0.0) } else { *target }, sum[c]);
        }
    }
}

/// Row blocks of the factor seen as one operand of a product.
pub(super) type RowBlocks<'a> = &'a [&'a [f64]];

/// Solves `triangle * y = y` in place for the triangle with these row blocks, `y` (columns, width).
pub(super) struct Forward<'a> {
    pub(super) rows: RowBlocks<'a>,
    pub(super) y: &'a mut [f64],
    pub(super) width: usize,
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
pub(super) struct Apply<'a> {
    pub(super) rows: RowBlocks<'a>,
    pub(super) y: &'a [f64],
    pub(super) target: &'a mut [f64],
    pub(super) width: usize,
    pub(super) overwrite: bool,
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
pub(super) struct Backward<'a> {
    pub(super) rows: RowBlocks<'a>,
    pub(super) x: &'a [f64],
    pub(super) block: usize,
    pub(super) y: &'a mut [f64],
    pub(super) width: usize,
    pub(super) pivots: Option<&'a [f64]>,
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
fn divide_transposed<S: Simd, const V: usize>(
    simd: S,
    x: &mut [[S::f64s; BLOCK]; V],
    pivots: &[f64; BLOCK * BLOCK],
) {
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
