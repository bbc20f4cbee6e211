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
mod real;
mod substitute;

pub(crate) use add_runs::{AddRuns, Run};
pub(crate) use eliminate::{Eliminate, Pivot};
pub(crate) use multiply::Product;
pub(crate) use real::Real;
pub(crate) use substitute::{Apply, Backward, Forward};

use pulp::Simd;

use crate::fronts::blocks::BLOCK;

/// Row blocks of the factor seen as one operand of a product.
pub(crate) type RowBlocks<'a, R = f64> = &'a [&'a [R]];

/// Sums over p of `a[v][p * stride] * b[p][c]` for all columns, `C` at a time.
#[inline(always)]
fn product<S: Simd, R: Real, const V: usize, const C: usize>(
    simd: S,
    a: [&[R::Vector<S>]; V],
    stride: usize,
    b: &[[R; BLOCK]],
) -> [[R::Vector<S>; BLOCK]; V] {
    let low = product_of_columns::<S, R, V, C>(simd, a, stride, b, 0);
    let high = if C < BLOCK { product_of_columns::<S, R, V, C>(simd, a, stride, b, C) } else { low };
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
fn product_of_columns<S: Simd, R: Real, const V: usize, const C: usize>(
    simd: S,
    a: [&[R::Vector<S>]; V],
    stride: usize,
    b: &[[R; BLOCK]],
    first: usize,
) -> [[R::Vector<S>; C]; V] {
    let mut sum = [[R::splat(simd, R::ZERO); C]; V];
    for (p, b) in b.iter().enumerate() {
        let b: &[R; C] = b[first..].first_chunk().expect("first is a multiple of C");
        let a: [R::Vector<S>; V] = std::array::from_fn(|v| a[v][p * stride]);
        for c in 0..C {
            let factor = R::splat(simd, b[c]);
            for v in 0..V {
                sum[v][c] = R::mul_add(simd, a[v], factor, sum[v][c]);
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
fn pivot_block<R: Real>(stored: &[R]) -> [R; BLOCK * BLOCK] {
    let mut block = [R::ZERO; BLOCK * BLOCK];
    block[..stored.len()].copy_from_slice(stored);
    block
}

/// Solves `x * pivots^T = x` for the columns x[v][0..8].
#[inline(always)]
fn divide<S: Simd, R: Real, const V: usize>(simd: S, x: &mut [[R::Vector<S>; BLOCK]; V], pivots: &[R; BLOCK * BLOCK]) {
    for c in 0..BLOCK {
        let inverse = R::splat(simd, pivots[BLOCK * c + c]);
        for v in 0..V {
            x[v][c] = R::mul(simd, x[v][c], inverse);
        }
        for later in c + 1..BLOCK {
            let factor = R::splat(simd, -pivots[BLOCK * c + later]);
            for v in 0..V {
                x[v][later] = R::mul_add(simd, x[v][c], factor, x[v][later]);
            }
        }
    }
}
