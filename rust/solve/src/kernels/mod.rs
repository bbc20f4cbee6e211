//! Dense arithmetic on row blocks (see `blocks`), compiled for AVX-512, AVX2 with FMA and plain code, chosen at run time.
//!
//! Everything is a sum of products of eight-wide streams held in registers: with 32 registers three vectors by eight
//! columns at a time, with 16 two by four (three by four spill; one by four wait for each other, at half the speed).
//! Each sum runs in one fixed order, so how rows are shared out among threads never shows in the bits.

// Indices are constants after unrolling, which is what keeps the sums in registers; iterators over them did not.
#![allow(clippy::needless_range_loop)]

mod add_runs;
mod eliminate;
mod multiply;
mod substitute;

pub(crate) use add_runs::{AddRuns, Run};
pub(crate) use eliminate::{Eliminate, Pivot};
pub(crate) use multiply::Product;
pub(crate) use substitute::{Apply, Backward, Forward};

use pulp::Simd;

use crate::fronts::blocks::BLOCK;

/// Row blocks of the factor seen as one operand of a product.
pub(crate) type RowBlocks<'a> = &'a [&'a [f64]];

/// Sums over p of `a[v][p * stride] * b[p][c]` for all columns, `C` at a time.
#[inline(always)]
fn product<S: Simd, const V: usize, const C: usize>(
    simd: S,
    a: [&[S::f64s]; V],
    stride: usize,
    b: &[[f64; BLOCK]],
) -> [[S::f64s; BLOCK]; V] {
    let low = product_of_columns::<S, V, C>(simd, a, stride, b, 0);
    let high = if C < BLOCK { product_of_columns::<S, V, C>(simd, a, stride, b, C) } else { low };
    eight_columns(&low, &high)
}

/// The first `C` (four or eight) columns and the rest.
#[inline(always)]
fn eight_columns<T: Copy, const V: usize, const C: usize>(low: &[[T; C]; V], high: &[[T; C]; V]) -> [[T; BLOCK]; V] {
    let mut all = [[low[0][0]; BLOCK]; V];
    for v in 0..V {
        for c in 0..BLOCK {
            all[v][c] = if c < C { low[v][c] } else { high[v][c - C] };
        }
    }
    all
}

/// The same for the columns from `first` on.
#[inline(always)]
fn product_of_columns<S: Simd, const V: usize, const C: usize>(
    simd: S,
    a: [&[S::f64s]; V],
    stride: usize,
    b: &[[f64; BLOCK]],
    first: usize,
) -> [[S::f64s; C]; V] {
    let mut sum = [[simd.splat_f64s(0.0); C]; V];
    for (p, b) in b.iter().enumerate() {
        let b: &[f64; C] = b[first..].first_chunk().expect("first is a multiple of C");
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

/// Row block in which vector `v` of neighbouring row blocks lies, and its place there.
fn vector_place<S: Simd>(v: usize) -> (usize, usize) {
    let stride = BLOCK / S::F64_LANES;
    (v / stride, v % stride)
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
