//! The two kinds of numbers that a factor may be stored in.

use bytemuck::Pod;
use pulp::Simd;

use crate::fronts::buffer::Buffer;

/// A floating-point number with the arithmetic of substitution.
pub(crate) trait Real:
    Pod + Default + PartialOrd + Send + Sync + std::fmt::Debug + std::ops::AddAssign + std::ops::Neg<Output = Self>
{
    /// Numbers of a cache line. Rows of right-hand sides are padded to a multiple: whole vectors on any machine.
    const LINE: usize = 64 / size_of::<Self>();
    const ZERO: Self;

    type Vector<S: Simd>: Copy;

    /// Numbers of a vector.
    fn lanes<S: Simd>() -> usize {
        size_of::<Self::Vector<S>>() / size_of::<Self>()
    }

    fn of(value: f64) -> Self;

    /// A buffer of these as one of `f64`.
    fn widen(values: Buffer<Self>) -> Buffer<f64>;

    /// Calls `fill` with memory for `f64` that is zero, and puts what it leaves there into `stored`, which is zero too.
    fn fill_stored<T>(stored: &mut [Self], fill: impl FnOnce(&mut [f64]) -> T) -> T;

    fn vectors<S: Simd>(values: &[Self]) -> &[Self::Vector<S>];

    fn vectors_mut<S: Simd>(values: &mut [Self]) -> &mut [Self::Vector<S>];

    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;

    fn sub<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;

    fn mul<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;

    /// `a b + c`.
    fn mul_add<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>, c: Self::Vector<S>) -> Self::Vector<S>;
}

impl Real for f64 {
    const ZERO: Self = 0.0;

    type Vector<S: Simd> = S::f64s;

    fn of(value: f64) -> Self {
        value
    }

    fn widen(values: Buffer<Self>) -> Buffer<f64> {
        values
    }

    fn fill_stored<T>(stored: &mut [Self], fill: impl FnOnce(&mut [f64]) -> T) -> T {
        fill(stored)
    }

    #[inline(always)]
    fn vectors<S: Simd>(values: &[Self]) -> &[S::f64s] {
        S::as_simd_f64s(values).0
    }

    #[inline(always)]
    fn vectors_mut<S: Simd>(values: &mut [Self]) -> &mut [S::f64s] {
        S::as_mut_simd_f64s(values).0
    }

    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f64s {
        simd.splat_f64s(value)
    }

    #[inline(always)]
    fn sub<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.sub_f64s(a, b)
    }

    #[inline(always)]
    fn mul<S: Simd>(simd: S, a: S::f64s, b: S::f64s) -> S::f64s {
        simd.mul_f64s(a, b)
    }

    #[inline(always)]
    fn mul_add<S: Simd>(simd: S, a: S::f64s, b: S::f64s, c: S::f64s) -> S::f64s {
        simd.mul_add_e_f64s(a, b, c)
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;

    type Vector<S: Simd> = S::f32s;

    fn of(value: f64) -> Self {
        value as f32
    }

    fn widen(values: Buffer<Self>) -> Buffer<f64> {
        let mut wide = Buffer::zeroed(values.len());
        wide.iter_mut().zip(&*values).for_each(|(wide, &value)| *wide = value.into());
        wide
    }

    fn fill_stored<T>(stored: &mut [Self], fill: impl FnOnce(&mut [f64]) -> T) -> T {
        let mut wide = vec![0.0; stored.len()];
        let result = fill(&mut wide);
        stored.iter_mut().zip(wide).for_each(|(stored, value)| *stored = value as f32);
        result
    }

    #[inline(always)]
    fn vectors<S: Simd>(values: &[Self]) -> &[S::f32s] {
        S::as_simd_f32s(values).0
    }

    #[inline(always)]
    fn vectors_mut<S: Simd>(values: &mut [Self]) -> &mut [S::f32s] {
        S::as_mut_simd_f32s(values).0
    }

    #[inline(always)]
    fn splat<S: Simd>(simd: S, value: Self) -> S::f32s {
        simd.splat_f32s(value)
    }

    #[inline(always)]
    fn sub<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.sub_f32s(a, b)
    }

    #[inline(always)]
    fn mul<S: Simd>(simd: S, a: S::f32s, b: S::f32s) -> S::f32s {
        simd.mul_f32s(a, b)
    }

    #[inline(always)]
    fn mul_add<S: Simd>(simd: S, a: S::f32s, b: S::f32s, c: S::f32s) -> S::f32s {
        simd.mul_add_e_f32s(a, b, c)
    }
}
