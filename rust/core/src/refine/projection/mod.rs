//! Projecting all constraints of a kind, batch by batch: eight side by side, compiled for AVX-512, AVX2 and plain code and
//! chosen at run time. The same bits everywhere, because the same operations are rounded in the same order.

// Indices are constants after unrolling; iterators over them are not inlined across instruction sets.
#![allow(clippy::needless_range_loop)]

mod batch;
mod colouring;

use pulp::{Arch, Simd, WithSimd};

pub use self::batch::{Batch, Particle};
pub use self::colouring::Colouring;
use super::constraint::{Constraint, energy, stretch, volume};
use super::number::{LANES, Lanes, Number, Vector, add};
use batch::{gather, scatter};

/// A kind of constraint: how its value comes from particles and rest numbers, and its compliance.
pub trait Kind<const N: usize, const M: usize>: Copy {
    /// Value and gradients.
    fn constraint<T: Number>(self, places: [Vector<T>; N], rest: [T; M]) -> Constraint<T, N>;
    /// Compliance of a constraint with these rest numbers.
    fn compliance<T: Number>(self, rest: [T; M]) -> T;
}

/// Edges keep their lengths. The number is the compliance.
#[derive(Debug, Clone, Copy)]
pub struct Stretch(pub f32);

/// Tetrahedra keep their volumes; rest numbers: volume, and its power 4/3. The number is the compliance relative to that.
#[derive(Debug, Clone, Copy)]
pub struct Volume(pub f32);

/// Corners keep their distances to the centre. The number is the compliance.
#[derive(Debug, Clone, Copy)]
pub struct Energy(pub f32);

impl Kind<2, 1> for Stretch {
    #[inline(always)]
    fn constraint<T: Number>(self, places: [Vector<T>; 2], rest: [T; 1]) -> Constraint<T, 2> {
        stretch(places, rest[0])
    }

    #[inline(always)]
    fn compliance<T: Number>(self, _rest: [T; 1]) -> T {
        T::constant(self.0)
    }
}

impl Kind<4, 2> for Volume {
    #[inline(always)]
    fn constraint<T: Number>(self, places: [Vector<T>; 4], rest: [T; 2]) -> Constraint<T, 4> {
        volume(places, rest[0])
    }

    #[inline(always)]
    fn compliance<T: Number>(self, rest: [T; 2]) -> T {
        T::constant(self.0) * rest[1]
    }
}

impl Kind<4, 4> for Energy {
    #[inline(always)]
    fn constraint<T: Number>(self, places: [Vector<T>; 4], rest: [T; 4]) -> Constraint<T, 4> {
        energy(places, rest)
    }

    #[inline(always)]
    fn compliance<T: Number>(self, _rest: [T; 4]) -> T {
        T::constant(self.0)
    }
}

/// How constraints are gone through. The answer is the same, to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// Eight side by side.
    Lanes,
    /// One after the other.
    Scalar,
}

/// Projects every constraint of `batch` once.
pub fn project<K: Kind<N, M>, const N: usize, const M: usize>(
    kernel: Kernel,
    kind: K,
    batch: &mut Batch<N, M>,
    particles: &mut [Particle],
) {
    match kernel {
        Kernel::Lanes => Arch::new().dispatch(Sweep { kind, batch, particles }),
        Kernel::Scalar => one_by_one(kind, batch, particles, 0, batch.len()),
    }
}

/// Projects the constraints of tetrahedra that have less than `least` of their volume towards `target` of it, one by one,
/// `passes` times over those that stay so thin; then looks for others, `rounds` times in all.
///
/// The sweeps converge slowly where a bend turns tetrahedra inside out; there are few of them.
pub fn untangle(
    batch: &Batch<4, 2>,
    particles: &mut [Particle],
    [least, target]: [f32; 2],
    passes: usize,
    rounds: usize,
) {
    let corners = |k: usize| [0, 1, 2, 3].map(|n| batch.particles[n][k] as usize);
    let value = |particles: &[Particle], k: usize, share: f32| {
        let places = corners(k).map(|p| [particles[p][0], particles[p][1], particles[p][2]]);
        volume(places, share * batch.rest[0][k])
    };
    for _ in 0..rounds {
        let mut left: Vec<usize> = (0..batch.len()).filter(|&k| value(particles, k, least).value < 0.0).collect();
        if left.is_empty() {
            return;
        }
        for _ in 0..passes {
            for &k in &left {
                let at = corners(k);
                let step = value(particles, k, target).project(at.map(|p| particles[p][3]), 0.0, 0.0);
                for (p, by) in at.into_iter().zip(step.moves) {
                    (0..3).for_each(|c| particles[p][c] += by[c]);
                }
            }
            left.retain(|&k| value(particles, k, least).value < 0.0);
        }
    }
}

struct Sweep<'a, K, const N: usize, const M: usize> {
    kind: K,
    batch: &'a mut Batch<N, M>,
    particles: &'a mut [Particle],
}

impl<K: Kind<N, M>, const N: usize, const M: usize> WithSimd for Sweep<'_, K, N, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { kind, batch, particles } = self;
        let mut from = 0;
        for b in 0..batch.ends.len() {
            let end = batch.ends[b] as usize;
            while from + LANES <= end {
                side_by_side(kind, batch, particles, from);
                from += LANES;
            }
            one_by_one(kind, batch, particles, from, end);
            from = end;
        }
        one_by_one(kind, batch, particles, from, batch.len());
    }
}

#[inline(always)]
fn side_by_side<K: Kind<N, M>, const N: usize, const M: usize>(
    kind: K,
    batch: &mut Batch<N, M>,
    particles: &mut [Particle],
    from: usize,
) {
    let (mut places, mut w) = ([[Lanes([0.0; LANES]); 3]; N], [Lanes([0.0; LANES]); N]);
    for n in 0..N {
        (places[n], w[n]) = gather(particles, eight(&batch.particles[n], from));
    }
    let mut rest = [Lanes([0.0; LANES]); M];
    for m in 0..M {
        rest[m] = Lanes(*eight(&batch.rest[m], from));
    }
    let multiplier = Lanes(*eight(&batch.multipliers, from));
    let step = kind.constraint(places, rest).project(w, kind.compliance(rest), multiplier);
    for n in 0..N {
        scatter(particles, eight(&batch.particles[n], from), add(places[n], step.moves[n]), w[n]);
    }
    let sum = multiplier + step.multiplier;
    batch.multipliers[from..from + LANES].copy_from_slice(&sum.0);
}

#[inline(always)]
fn eight<T>(column: &[T], from: usize) -> &[T; LANES] {
    column[from..].first_chunk().expect("a batch holds eight more")
}

#[inline(always)]
fn one_by_one<K: Kind<N, M>, const N: usize, const M: usize>(
    kind: K,
    batch: &mut Batch<N, M>,
    particles: &mut [Particle],
    from: usize,
    end: usize,
) {
    for k in from..end {
        let (mut places, mut w) = ([[0.0; 3]; N], [0.0; N]);
        for n in 0..N {
            let [x, y, z, mass] = particles[batch.particles[n][k] as usize];
            (places[n], w[n]) = ([x, y, z], mass);
        }
        let mut rest = [0.0; M];
        for m in 0..M {
            rest[m] = batch.rest[m][k];
        }
        let step = kind.constraint(places, rest).project(w, kind.compliance(rest), batch.multipliers[k]);
        for n in 0..N {
            let [x, y, z] = add(places[n], step.moves[n]);
            particles[batch.particles[n][k] as usize] = [x, y, z, w[n]];
        }
        batch.multipliers[k] += step.multiplier;
    }
}
