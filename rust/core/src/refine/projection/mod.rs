//! Projecting all constraints of a kind: blocks of particles side by side on all threads, then what lies between them;
//! within a block colour by colour, sixteen constraints side by side, compiled for AVX-512 and AVX2 and chosen at run
//! time. The same bits everywhere, because the same operations are rounded in the same order.

// Indices are constants after unrolling; iterators over them are not inlined across instruction sets.
#![allow(clippy::needless_range_loop)]

mod batch;
mod blocks;
mod colouring;
mod kind;
mod limit;
mod look;
mod octahedron;
mod register;
mod untangle;
#[cfg(target_arch = "x86_64")]
mod wide;

pub use self::batch::{Batch, Multipliers, Particle};
pub use self::blocks::Blocks;
pub use self::colouring::Colouring;
pub use self::kind::{Flesh, Kind, PartOfStretch, Stretch};
pub use self::limit::{Limits, OfNodes};
pub use self::octahedron::{MULTIPLIERS, NODES, Octahedra, SHARING};
use self::register::Register;
pub use self::untangle::{fill, untangle};
#[cfg(target_arch = "x86_64")]
use self::wide::{Wide, Widest};
use super::number::LANES;
#[cfg(not(target_arch = "x86_64"))]
use super::number::Lanes;

/// How constraints are gone through. The answer is the same, to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// Sixteen side by side, where the machine can.
    Lanes,
    /// One after the other, on one thread.
    Scalar,
}

/// Constraints of one run that are projected one by one.
const FEW: usize = 4;

/// Constraints that are worth a second thread.
const WORTH_A_THREAD: usize = 512;

/// Projects every constraint of `batch` once.
pub fn project<K: Kind<N, M, L>, const N: usize, const M: usize, const L: usize>(
    kernel: Kernel,
    kind: K,
    batch: &Batch<N, M>,
    multipliers: &mut Multipliers<L>,
    particles: &mut [Particle],
) {
    if batch.is_empty() {
        return;
    }
    let (before, own) = (batch.blocks.cut(0), batch.blocks.cut(batch.blocks.leaves()));
    let multipliers = multipliers.0.each_mut().map(Vec::as_mut_slice);
    let part = Part { kernel, kind, batch, multipliers, particles: &mut particles[before..own], base: before };
    part.project(1);
}

/// A block's share of everything: its constraints' multipliers, and its particles, of which the first has number `base`.
struct Part<'a, K, const N: usize, const M: usize, const L: usize> {
    kernel: Kernel,
    kind: K,
    batch: &'a Batch<N, M>,
    multipliers: [&'a mut [f32]; L],
    particles: &'a mut [Particle],
    base: usize,
}

impl<K: Kind<N, M, L>, const N: usize, const M: usize, const L: usize> Part<'_, K, N, M, L> {
    /// Both halves, then what lies between them.
    fn project(mut self, block: usize) {
        if block < self.batch.blocks.leaves() {
            self.halves(block);
        }
        let first = self.batch.first_of(block);
        self.sweep(block, first);
    }

    fn halves(&mut self, block: usize) {
        let batch = self.batch;
        let first = batch.first_of(block);
        let [middle, end] = [2 * block, 2 * block + 1].map(|half| batch.spans[half].to - first);
        let mut right: [&mut [f32]; L] = std::array::from_fn(|_| Default::default());
        let mut left: [&mut [f32]; L] = std::array::from_fn(|_| Default::default());
        for (l, column) in self.multipliers.iter_mut().enumerate() {
            (left[l], right[l]) = column[..end].split_at_mut(middle);
        }
        let cut = batch.blocks.cut(first_leaf(2 * block + 1, batch.blocks.leaves()));
        let (low, high) = self.particles.split_at_mut(cut - self.base);
        let (kernel, kind) = (self.kernel, self.kind);
        let left = Part { kernel, kind, batch, multipliers: left, particles: low, base: self.base };
        let right = Part { kernel, kind, batch, multipliers: right, particles: high, base: cut };
        let side_by_side = kernel == Kernel::Lanes && middle.min(end - middle) >= WORTH_A_THREAD;
        if side_by_side {
            rayon::join(|| left.project(2 * block), || right.project(2 * block + 1));
        } else {
            left.project(2 * block);
            right.project(2 * block + 1);
        }
    }

    /// The constraints of the block that are in none of its halves; the block's multipliers begin with constraint `first`.
    fn sweep(self, block: usize, first: usize) {
        let sweep = Sweep { block, first, part: self };
        match sweep.part.kernel {
            Kernel::Scalar => sweep.one_by_one(),
            Kernel::Lanes => sweep.side_by_side(),
        }
    }
}

fn first_leaf(mut block: usize, leaves: usize) -> usize {
    while block < leaves {
        block *= 2;
    }
    block - leaves
}

struct Sweep<'a, K, const N: usize, const M: usize, const L: usize> {
    block: usize,
    first: usize,
    part: Part<'a, K, N, M, L>,
}

impl<K: Kind<N, M, L>, const N: usize, const M: usize, const L: usize> Sweep<'_, K, N, M, L> {
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

    /// Run by run. Runs of a few constraints are not worth the registers.
    #[inline(always)]
    fn side_by_side_in<R: Register>(mut self, proof: R::Proof) {
        let batch = self.part.batch;
        let span = batch.spans[self.block];
        let mut from = span.from;
        for &end in &batch.ends[span.runs.0..span.runs.1] {
            let end = end as usize;
            if end - from < FEW {
                while from < end {
                    self.one(from);
                    from += 1;
                }
            }
            while from < end {
                let count = LANES.min(end - from);
                self.several::<R>(proof, from, count);
                from += count;
            }
        }
    }

    /// `count` constraints from `from` on, side by side.
    #[inline(always)]
    fn several<R: Register>(&mut self, proof: R::Proof, from: usize, count: usize) {
        let Self { first, part: Part { kind, batch, multipliers, particles, base, .. }, .. } = self;
        let mut at = [[0u32; LANES]; N];
        let (mut places, mut w) = ([[R::load(proof, &[0.0; LANES]); 3]; N], [R::load(proof, &[0.0; LANES]); N]);
        for n in 0..N {
            at[n] = indices(&batch.particles[n], from, count, *base as u32);
            (places[n], w[n]) = R::gather(proof, particles, &at[n]);
        }
        let mut rest = [R::load(proof, &[0.0; LANES]); M];
        for m in 0..M {
            rest[m] = R::load(proof, &some(&batch.rest[m], from, count));
        }
        let mut own = [R::load(proof, &[0.0; LANES]); L];
        for l in 0..L {
            own[l] = R::load(proof, &some(multipliers[l], from - *first, count));
        }
        kind.project(&mut places, w, rest, &mut own);
        for n in 0..N {
            R::scatter(places[n], w[n], particles, &at[n], count);
        }
        for l in 0..L {
            let mut column = [0.0; LANES];
            own[l].store(&mut column);
            let multipliers = &mut multipliers[l][from - *first..];
            // A copy of a length that is not known beforehand is a call, over which no register is kept.
            if count == LANES {
                *multipliers.first_chunk_mut().expect("sixteen more") = column;
            } else {
                multipliers[..count].copy_from_slice(&column[..count]);
            }
        }
    }

    #[inline(always)]
    fn one(&mut self, k: usize) {
        let Self { first, part: Part { kind, batch, multipliers, particles, base, .. }, .. } = self;
        let (mut places, mut w) = ([[0.0; 3]; N], [0.0; N]);
        for n in 0..N {
            let [x, y, z, mass] = particles[batch.particles[n][k] as usize - *base];
            (places[n], w[n]) = ([x, y, z], mass);
        }
        let mut rest = [0.0; M];
        for m in 0..M {
            rest[m] = batch.rest[m][k];
        }
        let mut own = [0.0; L];
        for l in 0..L {
            own[l] = multipliers[l][k - *first];
        }
        kind.project(&mut places, w, rest, &mut own);
        for n in 0..N {
            let [x, y, z] = places[n];
            particles[batch.particles[n][k] as usize - *base] = [x, y, z, w[n]];
        }
        for l in 0..L {
            multipliers[l][k - *first] = own[l];
        }
    }

    fn one_by_one(mut self) {
        let span = self.part.batch.spans[self.block];
        for k in span.from..span.to {
            self.one(k);
        }
    }
}

/// What is done with registers `R`, once the instructions are known to be there.
#[cfg(target_arch = "x86_64")]
struct With<R: Register, W>(R::Proof, W);

#[cfg(target_arch = "x86_64")]
impl<R, K, const N: usize, const M: usize, const L: usize> pulp::WithSimd for With<R, Sweep<'_, K, N, M, L>>
where
    R: Register,
    K: Kind<N, M, L>,
{
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        self.1.side_by_side_in::<R>(self.0);
    }
}

/// Numbers from `from` on; where a run ends before them, its last one again.
#[inline(always)]
fn some(column: &[f32], from: usize, count: usize) -> [f32; LANES] {
    if count == LANES {
        return *column[from..].first_chunk().expect("sixteen more");
    }
    let mut numbers = [column[from]; LANES];
    numbers[..count].copy_from_slice(&column[from..from + count]);
    numbers
}

/// The same of particles, counted from `base`.
#[inline(always)]
fn indices(column: &[u32], from: usize, count: usize, base: u32) -> [u32; LANES] {
    let mut some = [column[from] - base; LANES];
    if count == LANES {
        let column: &[u32; LANES] = column[from..].first_chunk().expect("sixteen more");
        for lane in 0..LANES {
            some[lane] = column[lane] - base;
        }
    } else {
        for lane in 0..count {
            some[lane] = column[from + lane] - base;
        }
    }
    some
}
