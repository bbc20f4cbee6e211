//! Elimination of a block column: in the rows below the diagonal, and in the diagonal block itself.

use pulp::{Simd, WithSimd};

use super::{divide, pivot_block, product, vector_place};
use crate::fronts::blocks::BLOCK;

/// Factors the block columns `first..last` of the row blocks `rows` of a panel, earlier ones being subtracted already.
/// `pivots` are the panel's row blocks before them, complete up to `last`.
pub(crate) struct Eliminate<'a, 'p, 'r> {
    pub(crate) pivots: &'a [&'p mut [f64]],
    pub(crate) rows: &'a mut [&'r mut [f64]],
    pub(crate) first: usize,
    pub(crate) last: usize,
    pub(crate) columns: usize,
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
                        let rows = [r0, r1, r2].map(|row| &mut row[skip..]);
                        eliminate_tile::<S, 3, 3, BLOCK>(simd, rows, before, &pivot, width);
                    }
                    _ => {
                        for row in rows.iter_mut().map(|row| [&mut row[skip..]]) {
                            if S::F64_LANES == BLOCK {
                                eliminate_tile::<S, 1, 1, BLOCK>(simd, row, before, &pivot, width);
                            } else {
                                eliminate_tile::<S, 1, 2, 4>(simd, row, before, &pivot, width);
                            }
                        }
                    }
                }
            }
        };
        rows.chunks_mut(3).for_each(tile);
    }
}

/// Eliminates one block column in `R` row blocks, `V` vectors at a time.
#[inline(always)]
fn eliminate_tile<S: Simd, const R: usize, const V: usize, const C: usize>(
    simd: S,
    rows: [&mut [f64]; R],
    before: &[[f64; BLOCK]],
    pivots: &[f64; BLOCK * BLOCK],
    width: usize,
) {
    let stride = BLOCK / S::F64_LANES;
    let start = stride * before.len();
    for group in 0..R * stride / V {
        let place: [(usize, usize); V] = std::array::from_fn(|v| vector_place::<S>(V * group + v));
        let mut x = {
            let done = place.map(|(row, part)| &S::as_simd_f64s(rows[row]).0[part..]);
            product::<S, f64, V, C>(simd, done, stride, before)
        };
        for v in 0..V {
            let (row, part) = place[v];
            let now = &S::as_simd_f64s(rows[row]).0[start..];
            for c in 0..BLOCK {
                let old = if c < width { now[c * stride + part] } else { simd.splat_f64s(0.0) };
                x[v][c] = simd.sub_f64s(old, x[v][c]);
            }
        }
        divide::<S, f64, V>(simd, &mut x, pivots);
        for v in 0..V {
            let (row, part) = place[v];
            let now = &mut S::as_mut_simd_f64s(&mut *rows[row]).0[start..];
            for c in 0..width {
                now[c * stride + part] = x[v][c];
            }
        }
    }
}

/// Factors the block on the diagonal at the end of `row`, its other columns being complete. A pivot must exceed its floor.
pub(crate) struct Pivot<'a> {
    pub(crate) row: &'a mut [f64],
    pub(crate) floors: &'a [f64],
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
            let [sum] = product::<S, f64, 1, BLOCK>(simd, [vectors], stride, done.as_chunks().0);
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
