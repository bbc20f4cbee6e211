//! Products of row blocks, where most of the work of a factorisation is.

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::{RowBlocks, product, vector_place};
use crate::fronts::blocks::BLOCK;

/// Columns that a product sums up before it stores, and row blocks it keeps at hand meanwhile: half a megabyte.
const DEPTH: usize = 256;
const BREADTH: usize = 32;

/// Subtracts from (or overwrites with the negative of) a trapezoid of blocks the product of row blocks `a` with `b`,
/// transposed: block column j of `target[i]` gets `a[i] * b[j]^T` for every j up to `first + i`.
pub(crate) struct Product<'a, 't> {
    pub(crate) a: RowBlocks<'a>,
    pub(crate) b: RowBlocks<'a>,
    pub(crate) target: &'a mut [&'t mut [f64]],
    pub(crate) first: usize,
    pub(crate) overwrite: bool,
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
            (&[a0, a1, a2], [t0, t1, t2]) if S::F64_LANES == BLOCK && column <= row => {
                let a = [a0, a1, a2].map(|a| &a[depth.clone()]);
                let target = [t0, t1, t2].map(|target| block_mut(target, column));
                subtract_tile::<S, 3, 3, BLOCK>(simd, target, a, b, overwrite);
            }
            (a, target) => {
                for (i, (a, target)) in a.iter().zip(target).enumerate() {
                    if column <= row + i {
                        let (a, target) = ([&a[depth.clone()]], [block_mut(target, column)]);
                        if S::F64_LANES == BLOCK {
                            subtract_tile::<S, 1, 1, BLOCK>(simd, target, a, b, overwrite);
                        } else {
                            subtract_tile::<S, 1, 2, 4>(simd, target, a, b, overwrite);
                        }
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

/// Subtracts the product of `a` and `b` from a block of each of `R` row blocks (or stores its negative), `V` vectors and
/// `C` columns at a time.
#[inline(always)]
fn subtract_tile<S: Simd, const R: usize, const V: usize, const C: usize>(
    simd: S,
    target: [&mut [f64]; R],
    a: [&[f64]; R],
    b: &[[f64; BLOCK]],
    overwrite: bool,
) {
    let stride = BLOCK / S::F64_LANES;
    for group in 0..R * stride / V {
        let place: [(usize, usize); V] = std::array::from_fn(|v| vector_place::<S>(V * group + v));
        let a = place.map(|(row, part)| S::as_simd_f64s(a[row]).0.get(part..).unwrap_or_default());
        let sum = product::<S, f64, V, C>(simd, a, stride, b);
        for v in 0..V {
            let (row, part) = place[v];
            let target = S::as_mut_simd_f64s(target[row]).0;
            for c in 0..BLOCK {
                if let Some(target) = target.get_mut(c * stride + part) {
                    *target = simd.sub_f64s(if overwrite { simd.splat_f64s(0.0) } else { *target }, sum[v][c]);
                }
            }
        }
    }
}
