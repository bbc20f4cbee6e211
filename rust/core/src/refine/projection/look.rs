//! Looking for constraints that a measure finds below zero, eight side by side as the sweeps go.

// Indices are constants after unrolling; iterators over them are not inlined across instruction sets.
#![allow(clippy::needless_range_loop)]

use std::ops::Range;

use super::super::number::{LANES, Lanes};
use super::batch::{Batch, Particle};
use super::kind::Measure;
use super::register::Register;
#[cfg(target_arch = "x86_64")]
use super::wide::Wide;
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
        if let Some(simd) = pulp::x86::V3::try_new() {
            return pulp::Simd::vectorize(simd, WithWide { simd, look: self });
        }
        self.eights::<Lanes>(());
    }

    #[inline(always)]
    fn eights<R: Register>(mut self, proof: R::Proof) {
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
struct WithWide<'a, F, G, const N: usize, const M: usize> {
    simd: pulp::x86::V3,
    look: Look<'a, F, G, N, M>,
}

#[cfg(target_arch = "x86_64")]
impl<F: Measure<N>, G: FnMut(usize), const N: usize, const M: usize> pulp::WithSimd for WithWide<'_, F, G, N, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        self.look.eights::<Wide>(self.simd);
    }
}
