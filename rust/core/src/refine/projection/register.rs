//! Sixteen numbers side by side, as the sweeps take them: in a register where the machine has one, else in an array.

#![allow(clippy::needless_range_loop)]

use super::super::number::{LANES, Lanes, Number, Vector};
use super::batch::Particle;

/// Sixteen numbers that come from columns and from the rows of particles.
pub(super) trait Register: Number {
    /// The proof that the machine has the instructions.
    type Proof: Copy;

    fn load(proof: Self::Proof, column: &[f32; LANES]) -> Self;
    fn store(self, column: &mut [f32; LANES]);
    /// Sixteen places and inverse masses.
    fn gather(proof: Self::Proof, particles: &[Particle], at: &[u32; LANES]) -> (Vector<Self>, Self);
    /// Writes the first `count` of sixteen places; masses stay.
    fn scatter(places: Vector<Self>, masses: Self, particles: &mut [Particle], at: &[u32; LANES], count: usize);
}

impl Register for Lanes {
    type Proof = ();

    #[inline(always)]
    fn load((): (), column: &[f32; LANES]) -> Self {
        Self(*column)
    }

    #[inline(always)]
    fn store(self, column: &mut [f32; LANES]) {
        *column = self.0;
    }

    #[inline(always)]
    fn gather((): (), particles: &[Particle], at: &[u32; LANES]) -> (Vector<Self>, Self) {
        let mut columns = [[0.0; LANES]; 4];
        for lane in 0..LANES {
            let particle = &particles[at[lane] as usize];
            for c in 0..4 {
                columns[c][lane] = particle[c];
            }
        }
        let [x, y, z, w] = columns;
        ([Lanes(x), Lanes(y), Lanes(z)], Lanes(w))
    }

    #[inline(always)]
    fn scatter([x, y, z]: Vector<Self>, w: Self, particles: &mut [Particle], at: &[u32; LANES], count: usize) {
        for lane in 0..count {
            particles[at[lane] as usize] = [x.0[lane], y.0[lane], z.0[lane], w.0[lane]];
        }
    }
}
