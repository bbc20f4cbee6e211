//! Looking for constraints that a measure finds below zero, sixteen side by side as the sweeps go.

// Indices are constants after unrolling; iterators over them are not inlined across instruction sets.
#![allow(clippy::needless_range_loop)]

use std::ops::Range;

use super::super::number::LANES;
#[cfg(not(target_arch = "x86_64"))]
use super::super::number::Lanes;
#[cfg(target_arch = "x86_64")]
use super::With;
use super::batch::{Batch, Particle};
use super::kind::Measure;
use super::register::Register;
#[cfg(target_arch = "x86_64")]
use super::wide::{Wide, Widest};
use super::{Kernel, indices};

/// Calls `found` with those of `range`, ascending, whose measure is below zero.
pub(super) fn look<F: Measure<N>, const N: usize, const M: usize>(
    kernel: Kernel,
    measure: F,
    batch: &Batch<N, M>,
    range: Range<usize>,
    particles: &[Particle],
    found: impl FnMut(usize),
) {
    let look = Look { measure, batch, range, particles, found };
    match kernel {
        Kernel::Scalar => look.one_by_one(),
        Kernel::Lanes => look.side_by_side(),
    }
}

struct Look<'a, F, G, const N: usize, const M: usize> {
    measure: F,
    batch: &'a Batch<N, M>,
    range: Range<usize>,
    particles: &'a [Particle],
    found: G,
}

impl<F: Measure<N>, G: FnMut(usize), const N: usize, const M: usize> Look<'_, F, G, N, M> {
    fn side_by_side(self) {
        #[cfg(target_arch = "x86_64")]
        {
            if let Some(simd) = pulp::x86::V4::try_new() {
                return pulp::Simd::vectorize(simd, With::<Widest, _>(simd, self));
            }
            if let Some(simd) = pulp::x86::V3::try_new() {
                return pulp::Simd::vectorize(simd, With::<Wide, _>(simd, self));
            }
        }
        #[cfg(target_arch = "x86_64")]
        self.one_by_one();
        #[cfg(not(target_arch = "x86_64"))]
        self.side_by_side_in::<Lanes>(());
    }

    #[inline(always)]
    fn side_by_side_in<R: Register>(mut self, proof: R::Proof) {
        for from in self.range.clone().step_by(LANES) {
            let count = LANES.min(self.range.end - from);
            let (mut places, mut any) = ([[R::load(proof, &[0.0; LANES]); 3]; N], R::load(proof, &[0.0; LANES]));
            for n in 0..N {
                let at = indices(&self.batch.particles[n], from, count, 0);
                (places[n], any) = R::gather(proof, self.particles, &at);
            }
            let mut values = [0.0; LANES];
            self.measure.of(places, any).store(&mut values);
            for lane in 0..count {
                if values[lane] < 0.0 {
                    (self.found)(from + lane);
                }
            }
        }
    }

    fn one_by_one(mut self) {
        for k in self.range {
            let place = |n: usize| {
                let [x, y, z, _] = self.particles[self.batch.particles[n][k] as usize];
                [x, y, z]
            };
            if self.measure.of(std::array::from_fn(place), 0.0f32) < 0.0 {
                (self.found)(k);
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl<R, F, G, const N: usize, const M: usize> pulp::WithSimd for With<R, Look<'_, F, G, N, M>>
where
    R: Register,
    F: Measure<N>,
    G: FnMut(usize),
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        self.1.side_by_side_in::<R>(self.0);
    }
}
