//! Products of row blocks, where most of the work of a factorisation is.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::super::blocks::BLOCK;
use super::{RowBlocks, product};

/// Columns that a product sums up before it stores, and row blocks it keeps at hand meanwhile: half a megabyte.
const DEPTH: usize = 256;
const BREADTH: usize = 32;

/// Subtracts from (or overwrites with the negative of) a trapezoid of blocks the product of row blocks `a` with `b`,
/// transposed: block column j of `target[i]` gets `a[i] * b[j]^T` for every j up to `first + i`.
pub(in super::super) struct Product<'a, 't> {
    pub(in super::super) a: RowBlocks<'a>,
    pub(in super::super) b: RowBlocks<'a>,
    pub(in super::super) target: &'a mut [&'t mut [f64]],
    pub(in super::super) first: usize,
    pub(in super::super) overwrite: bool,
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
fn block_mut(row: &mut [f64], column: usize) -> &mut [f64] {
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
