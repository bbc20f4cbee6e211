//! What the constraints calculate with: one number, or sixteen side by side with the same bits.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Numbers side by side: one register of AVX-512, two of AVX2.
pub const LANES: usize = 16;

/// The arithmetic that the constraints need. No fused operations: every implementation rounds in the same way.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// A constant of the same kind: wide numbers carry the proof that their instructions exist.
    fn constant(self, value: f32) -> Self;
    /// The square root.
    fn sqrt(self) -> Self;
    /// The lesser of two numbers, neither of which may be NaN.
    fn lesser(self, other: Self) -> Self;
    /// `yes` where this number is less than the other, else `no`.
    fn if_less(self, other: Self, yes: Self, no: Self) -> Self;
}

macro_rules! scalar {
    ($kind:ty) => {
        impl Number for $kind {
            #[inline(always)]
            fn constant(self, value: f32) -> Self {
                Self::from(value)
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                self.sqrt()
            }

            #[inline(always)]
            fn lesser(self, other: Self) -> Self {
                if self < other { self } else { other }
            }

            #[inline(always)]
            fn if_less(self, other: Self, yes: Self, no: Self) -> Self {
                if self < other { yes } else { no }
            }
        }
    };
}

scalar!(f32);
scalar!(f64);

/// Sixteen numbers. Loops instead of closures, which are not compiled for the instruction set that calls them.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub struct Lanes(pub [f32; LANES]);

macro_rules! lanewise {
    ($operator:ident, $method:ident, $op:tt) => {
        impl $operator for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for lane in 0..LANES {
                    self.0[lane] $op other.0[lane];
                }
                self
            }
        }
    };
}

lanewise!(Add, add, +=);
lanewise!(Sub, sub, -=);
lanewise!(Mul, mul, *=);
lanewise!(Div, div, /=);

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = -self.0[lane];
        }
        self
    }
}

impl Number for Lanes {
    #[inline(always)]
    fn constant(self, value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn sqrt(mut self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = self.0[lane].sqrt();
        }
        self
    }

    #[inline(always)]
    fn lesser(mut self, other: Self) -> Self {
        for lane in 0..LANES {
            self.0[lane] = if self.0[lane] < other.0[lane] { self.0[lane] } else { other.0[lane] };
        }
        self
    }

    #[inline(always)]
    fn if_less(self, other: Self, mut yes: Self, no: Self) -> Self {
        for lane in 0..LANES {
            yes.0[lane] = if self.0[lane] < other.0[lane] { yes.0[lane] } else { no.0[lane] };
        }
        yes
    }
}

/// A point or direction.
pub type Vector<T> = [T; 3];

#[inline(always)]
pub(super) fn sub<T: Number>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn add<T: Number>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn scaled<T: Number>(a: Vector<T>, by: T) -> Vector<T> {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
pub(super) fn dot<T: Number>(a: Vector<T>, b: Vector<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn cross<T: Number>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
