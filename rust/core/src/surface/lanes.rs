//! One number for each of a few queries, and arithmetic on all of them at once.
//!
//! Methods on registers instead of closures and iterators: across instruction sets only what is marked is inlined.

use std::ops::{Add, Mul, Sub};

use pulp::Simd;

/// Queries that are searched for together: whole registers on any machine, of AVX2 two, which hide each other's latency.
pub(super) const LANES: usize = 16;

/// One number of each query.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

impl Lanes {
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    /// The lanes in which this is at most the other, as bits.
    #[inline(always)]
    pub(super) fn at_most(&self, other: &Self) -> u32 {
        let mut mask = 0;
        for lane in 0..LANES {
            mask |= u32::from(self.0[lane] <= other.0[lane]) << lane;
        }
        mask
    }
}

/// A register of numbers.
#[derive(Clone, Copy)]
pub(super) struct Register<S: Simd> {
    simd: S,
    value: S::f32s,
}

impl<S: Simd> Register<S> {
    /// How many make up [`Lanes`].
    pub(super) const COUNT: usize = LANES / S::F32_LANES;

    /// Register `k` of `lanes`.
    #[inline(always)]
    pub(super) fn load(simd: S, lanes: &Lanes, k: usize) -> Self {
        Self { simd, value: S::as_simd_f32s(&lanes.0).0[k] }
    }

    /// Writes register `k` of `lanes`.
    #[inline(always)]
    pub(super) fn store(self, lanes: &mut Lanes, k: usize) {
        S::as_mut_simd_f32s(&mut lanes.0).0[k] = self.value;
    }

    #[inline(always)]
    pub(super) fn splat(simd: S, value: f32) -> Self {
        Self { simd, value: simd.splat_f32s(value) }
    }

    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self { value: self.simd.min_f32s(self.value, other.value), ..self }
    }

    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self { value: self.simd.max_f32s(self.value, other.value), ..self }
    }

    /// `x` where this is positive, 0 elsewhere.
    #[inline(always)]
    pub(super) fn positive_then(self, x: Self) -> Self {
        let zero = self.simd.splat_f32s(0.0);
        let mask = self.simd.less_than_f32s(zero, self.value);
        Self { value: self.simd.select_f32s(mask, x.value, zero), ..self }
    }

    /// The smaller one, `other` where this is NaN.
    #[inline(always)]
    pub(super) fn but_at_most(self, other: Self) -> Self {
        let mask = self.simd.less_than_f32s(self.value, other.value);
        Self { value: self.simd.select_f32s(mask, self.value, other.value), ..self }
    }
}

/// Coordinates of a point in the frame of `axes` at `origin`.
#[inline(always)]
pub(super) fn into_frame<S: Simd>(
    simd: S,
    [x, y, z]: [Register<S>; 3],
    origin: &[f32; 3],
    [a, b, c]: &[[f32; 3]; 3],
) -> [Register<S>; 3] {
    let x = x - Register::splat(simd, origin[0]);
    let y = y - Register::splat(simd, origin[1]);
    let z = z - Register::splat(simd, origin[2]);
    [along(simd, a, x, y, z), along(simd, b, x, y, z), along(simd, c, x, y, z)]
}

#[inline(always)]
fn along<S: Simd>(simd: S, axis: &[f32; 3], x: Register<S>, y: Register<S>, z: Register<S>) -> Register<S> {
    x * Register::splat(simd, axis[0]) + y * Register::splat(simd, axis[1]) + z * Register::splat(simd, axis[2])
}

impl<S: Simd> Add for Register<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.simd.add_f32s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Sub for Register<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.simd.sub_f32s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Mul for Register<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { value: self.simd.mul_f32s(self.value, other.value), ..self }
    }
}
