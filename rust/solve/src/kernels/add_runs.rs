//! The way of a child's update into its parent's front.

use pulp::{Simd, WithSimd};

use crate::fronts::blocks::{BLOCK, triangle_len};

/// Neighbouring rows of an update that become neighbouring rows of one row block of the parent.
pub(crate) struct Run {
    /// First row in the update, and the number of rows, all in one row block of either side.
    pub(crate) row: usize,
    pub(crate) count: usize,
    /// Row block and lane of the first row in the parent.
    pub(crate) block: usize,
    pub(crate) lane: usize,
}

/// Adds rows of an update to row blocks of the parent. Column `first + j` goes to where `columns[j]` says in a row block.
/// What lies above the diagonal of a block on the diagonal is never used, so that runs need not heed it.
pub(crate) struct AddRuns<'a, 't> {
    pub(crate) update: &'a [f64],
    pub(crate) runs: &'a [Run],
    pub(crate) first: usize,
    pub(crate) columns: &'a [u32],
    pub(crate) target: &'a mut [&'t mut [f64]],
}

impl WithSimd for AddRuns<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { update, runs, first, columns, target } = self;
        for &Run { row, count, block, lane } in runs {
            let columns = &columns[..columns.len().min((row + count).saturating_sub(first))];
            let start = triangle_len(row / BLOCK) + row % BLOCK + BLOCK * first;
            let target = &mut target[block];
            // The eight numbers around each column's part of the run, of which the others are masked.
            let around = start.checked_sub(lane).and_then(|start| update.get(start..start + BLOCK * columns.len()));
            let Some(around) = around else {
                for (values, &column) in update[start..].chunks(BLOCK).zip(columns) {
                    let target = &mut target[column as usize + lane..];
                    target.iter_mut().zip(&values[..count]).for_each(|(target, value)| *target += value);
                }
                continue;
            };
            let mut kept = [0.0; BLOCK];
            kept[lane..lane + count].fill(1.0);
            let kept = S::as_simd_f64s(&kept).0;
            for (values, &column) in around.as_chunks::<BLOCK>().0.iter().zip(columns) {
                let target = S::as_mut_simd_f64s(&mut target[column as usize..][..BLOCK]).0;
                let values = S::as_simd_f64s(values).0;
                for part in 0..BLOCK / S::F64_LANES {
                    target[part] = simd.mul_add_e_f64s(values[part], kept[part], target[part]);
                }
            }
        }
    }
}
