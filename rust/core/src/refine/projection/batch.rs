//! Particles, and constraints of one kind over them, as arrays for the kernels.

use super::super::number::{LANES, Lanes, Vector};
use super::colouring::Colouring;

/// Place and inverse mass of a particle: x, y, z, w.
pub type Particle = [f32; 4];

/// Constraints of one kind in projection order, each over `N` particles with `M` numbers at rest.
#[derive(Debug, Clone)]
pub struct Batch<const N: usize, const M: usize> {
    /// Particles, an array per corner.
    pub particles: [Vec<u32>; N],
    /// What each constraint keeps.
    pub rest: [Vec<f32>; M],
    /// Multipliers so far.
    pub multipliers: Vec<f32>,
    /// Ends of the batches without a shared particle.
    pub ends: Vec<u32>,
}

impl<const N: usize, const M: usize> Batch<N, M> {
    /// Of the constraints that `colouring` names, in its order.
    pub fn new(colouring: &Colouring, particles: impl Fn(u32) -> [u32; N], rest: impl Fn(u32) -> [f32; M]) -> Self {
        let count = colouring.order.len();
        let mut batch = Self {
            particles: std::array::from_fn(|_| Vec::with_capacity(count)),
            rest: std::array::from_fn(|_| Vec::with_capacity(count)),
            multipliers: vec![0.0; count],
            ends: colouring.ends.clone(),
        };
        for &k in &colouring.order {
            particles(k).into_iter().zip(&mut batch.particles).for_each(|(p, column)| column.push(p));
            rest(k).into_iter().zip(&mut batch.rest).for_each(|(x, column)| column.push(x));
        }
        batch
    }

    /// Number of constraints.
    pub fn len(&self) -> usize {
        self.multipliers.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.multipliers.is_empty()
    }

    /// Forgets the multipliers: the next projection starts from where the particles then are.
    pub fn restart(&mut self) {
        self.multipliers.fill(0.0);
    }
}

/// Eight particles: places and inverse masses.
#[inline(always)]
pub(super) fn gather(particles: &[Particle], at: &[u32; LANES]) -> (Vector<Lanes>, Lanes) {
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

/// Writes eight places; masses stay.
#[inline(always)]
pub(super) fn scatter(particles: &mut [Particle], at: &[u32; LANES], [x, y, z]: Vector<Lanes>, w: Lanes) {
    for lane in 0..LANES {
        particles[at[lane] as usize] = [x.0[lane], y.0[lane], z.0[lane], w.0[lane]];
    }
}
