//! Eight numbers in one register of AVX2, and particles turned from rows into columns there.

// Indices are constants after unrolling; iterators over them are not inlined across instruction sets.
#![allow(clippy::needless_range_loop)]

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::x86::V3;
use pulp::{Simd, cast, f32x8};

use super::super::number::{LANES, Number, Vector};
use super::batch::Particle;
use super::register::Register;

/// Eight numbers, with the proof that the machine has the instructions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wide {
    simd: V3,
    value: f32x8,
}

macro_rules! operation {
    ($operator:ident, $method:ident, $instruction:ident) => {
        impl $operator for Wide {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { value: self.simd.$instruction(self.value, other.value), ..self }
            }
        }
    };
}

operation!(Add, add, add_f32s);
operation!(Sub, sub, sub_f32s);
operation!(Mul, mul, mul_f32s);
operation!(Div, div, div_f32s);

impl Neg for Wide {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: self.simd.neg_f32s(self.value), ..self }
    }
}

impl Number for Wide {
    #[inline(always)]
    fn constant(self, value: f32) -> Self {
        Self { value: self.simd.splat_f32s(value), ..self }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self { value: self.simd.sqrt_f32s(self.value), ..self }
    }

    #[inline(always)]
    fn lesser(self, other: Self) -> Self {
        Self { value: self.simd.min_f32s(self.value, other.value), ..self }
    }

    #[inline(always)]
    fn if_less(self, other: Self, yes: Self, no: Self) -> Self {
        let is_less = self.simd.less_than_f32s(self.value, other.value);
        Self { value: self.simd.select_f32s(is_less, yes.value, no.value), ..self }
    }
}

impl Register for Wide {
    type Proof = V3;

    #[inline(always)]
    fn load(simd: V3, column: &[f32; LANES]) -> Self {
        Self { simd, value: cast(*column) }
    }

    #[inline(always)]
    fn store(self, column: &mut [f32; LANES]) {
        *column = cast(self.value);
    }

    /// Rows are loaded whole and turned in registers: what is written number by number and read as a register stalls.
    #[inline(always)]
    fn gather(simd: V3, particles: &[Particle], at: &[u32; LANES]) -> (Vector<Self>, Self) {
        let mut rows = [simd.splat_f32s(0.0); 4];
        for k in 0..4 {
            rows[k] = two(simd, particles[at[k] as usize], particles[at[k + 4] as usize]);
        }
        let [x, y, z, w] = simd.deinterleave_shfl_f32s(rows);
        let place = [Self { simd, value: x }, Self { simd, value: y }, Self { simd, value: z }];
        (place, Self { simd, value: w })
    }

    #[inline(always)]
    fn scatter([x, y, z]: Vector<Self>, w: Self, particles: &mut [Particle], at: &[u32; LANES], count: usize) {
        let rows = x.simd.interleave_shfl_f32s([x.value, y.value, z.value, w.value]);
        if count == LANES {
            for k in 0..4 {
                let [low, high]: [Particle; 2] = cast(rows[k]);
                particles[at[k] as usize] = low;
                particles[at[k + 4] as usize] = high;
            }
        } else {
            let rows: [[Particle; 2]; 4] = cast(rows);
            for k in 0..count {
                particles[at[k] as usize] = rows[k % 4][k / 4];
            }
        }
    }
}

#[inline(always)]
fn two(simd: V3, low: Particle, high: Particle) -> f32x8 {
    cast(simd.avx._mm256_set_m128(cast(high), cast(low)))
}
