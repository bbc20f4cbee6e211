//! Sixteen numbers in a register of AVX-512 or in two of AVX2, and particles turned from rows into columns there.

// Indices are constants after unrolling; iterators over them are not inlined across instruction sets.
#![allow(clippy::needless_range_loop)]

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::x86::{V3, V4};
use pulp::{Simd, cast, f32x8, f32x16};

use super::super::number::{LANES, Number, Vector};
use super::batch::Particle;
use super::register::Register;

/// With the proof that the machine has AVX2.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wide {
    simd: V3,
    low: f32x8,
    high: f32x8,
}

/// With the proof that the machine has AVX-512.
#[derive(Debug, Clone, Copy)]
pub(super) struct Widest {
    simd: V4,
    all: f32x16,
}

/// Arithmetic on the fields of a type: no loops over them, which cost a minute of compiling.
macro_rules! arithmetic {
    ($name:ident, $($field:ident),+) => {
        arithmetic!(operator $name, Add, add, add_f32s, $($field),+);
        arithmetic!(operator $name, Sub, sub, sub_f32s, $($field),+);
        arithmetic!(operator $name, Mul, mul, mul_f32s, $($field),+);
        arithmetic!(operator $name, Div, div, div_f32s, $($field),+);

        impl Neg for $name {
            type Output = Self;

            #[inline(always)]
            fn neg(self) -> Self {
                Self { simd: self.simd, $($field: self.simd.neg_f32s(self.$field)),+ }
            }
        }

        impl Number for $name {
            #[inline(always)]
            fn constant(self, value: f32) -> Self {
                Self { simd: self.simd, $($field: self.simd.splat_f32s(value)),+ }
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                Self { simd: self.simd, $($field: self.simd.sqrt_f32s(self.$field)),+ }
            }

            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                Self { simd: self.simd, $($field: self.simd.min_f32s(self.$field, other.$field)),+ }
            }

            #[inline(always)]
            fn if_less(self, other: Self, yes: Self, no: Self) -> Self {
                let simd = self.simd;
                $(let $field = simd.less_than_f32s(self.$field, other.$field);)+
                Self { simd, $($field: simd.select_f32s($field, yes.$field, no.$field)),+ }
            }
        }
    };
    (operator $name:ident, $operator:ident, $method:ident, $instruction:ident, $($field:ident),+) => {
        impl $operator for $name {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { simd: self.simd, $($field: self.simd.$instruction(self.$field, other.$field)),+ }
            }
        }
    };
}

arithmetic!(Wide, low, high);
arithmetic!(Widest, all);

/// Rows are loaded whole and turned in registers: what is written number by number and read as a register stalls.
impl Register for Wide {
    type Proof = V3;

    #[inline(always)]
    fn load(simd: V3, column: &[f32; LANES]) -> Self {
        let [low, high] = cast(*column);
        Self { simd, low, high }
    }

    #[inline(always)]
    fn store(self, column: &mut [f32; LANES]) {
        *column = cast([self.low, self.high]);
    }

    #[inline(always)]
    fn gather(simd: V3, particles: &[Particle], at: &[u32; LANES]) -> (Vector<Self>, Self) {
        let [mut low, mut high] = [[simd.splat_f32s(0.0); 4]; 2];
        for k in 0..4 {
            low[k] = two(simd, particles, at, k);
            high[k] = two(simd, particles, at, k + 8);
        }
        let ([a, b, c, d], [e, f, g, h]) = (simd.deinterleave_shfl_f32s(low), simd.deinterleave_shfl_f32s(high));
        let [x, y] = [Self { simd, low: a, high: e }, Self { simd, low: b, high: f }];
        ([x, y, Self { simd, low: c, high: g }], Self { simd, low: d, high: h })
    }

    #[inline(always)]
    fn scatter([x, y, z]: Vector<Self>, w: Self, particles: &mut [Particle], at: &[u32; LANES], count: usize) {
        let low: [[Particle; 2]; 4] = cast(x.simd.interleave_shfl_f32s([x.low, y.low, z.low, w.low]));
        let high: [[Particle; 2]; 4] = cast(x.simd.interleave_shfl_f32s([x.high, y.high, z.high, w.high]));
        if count == LANES {
            for k in 0..4 {
                particles[at[k] as usize] = low[k][0];
                particles[at[k + 4] as usize] = low[k][1];
                particles[at[k + 8] as usize] = high[k][0];
                particles[at[k + 12] as usize] = high[k][1];
            }
        } else {
            for lane in 0..count {
                let rows = if lane < 8 { &low } else { &high };
                particles[at[lane] as usize] = rows[lane % 4][lane / 4 % 2];
            }
        }
    }
}

impl Register for Widest {
    type Proof = V4;

    #[inline(always)]
    fn load(simd: V4, column: &[f32; LANES]) -> Self {
        Self { simd, all: cast(*column) }
    }

    #[inline(always)]
    fn store(self, column: &mut [f32; LANES]) {
        *column = cast(self.all);
    }

    #[inline(always)]
    fn gather(simd: V4, particles: &[Particle], at: &[u32; LANES]) -> (Vector<Self>, Self) {
        let mut rows = [simd.splat_f32s(0.0); 4];
        for k in 0..4 {
            rows[k] = four(simd, particles, at, k);
        }
        let [x, y, z, w] = simd.deinterleave_shfl_f32s(rows);
        ([Self { simd, all: x }, Self { simd, all: y }, Self { simd, all: z }], Self { simd, all: w })
    }

    #[inline(always)]
    fn scatter([x, y, z]: Vector<Self>, w: Self, particles: &mut [Particle], at: &[u32; LANES], count: usize) {
        let rows: [[Particle; 4]; 4] = cast(x.simd.interleave_shfl_f32s([x.all, y.all, z.all, w.all]));
        if count == LANES {
            for k in 0..4 {
                particles[at[k] as usize] = rows[k][0];
                particles[at[k + 4] as usize] = rows[k][1];
                particles[at[k + 8] as usize] = rows[k][2];
                particles[at[k + 12] as usize] = rows[k][3];
            }
        } else {
            for lane in 0..count {
                particles[at[lane] as usize] = rows[lane % 4][lane / 4];
            }
        }
    }
}

/// The particles of a lane and of the fourth after it.
#[inline(always)]
fn two(simd: V3, particles: &[Particle], at: &[u32; LANES], lane: usize) -> f32x8 {
    let [low, high] = [particles[at[lane] as usize], particles[at[lane + 4] as usize]];
    cast(simd.avx._mm256_set_m128(cast(high), cast(low)))
}

/// The particles of a lane, of the fourth after it, of the eighth and of the twelfth.
#[inline(always)]
fn four(simd: V4, particles: &[Particle], at: &[u32; LANES], lane: usize) -> f32x16 {
    cast([two(*simd, particles, at, lane), two(*simd, particles, at, lane + 8)])
}
