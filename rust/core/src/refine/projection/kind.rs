//! What is projected together: the numbers of a kind of constraint, and what it does to its particles.

#![allow(clippy::needless_range_loop)]

use super::super::constraint::{Constraint, Projection, project_energy, project_stretch, volume};
use super::super::number::{Number, Vector, add};

/// Constraints over `N` particles with `M` numbers at rest and `L` multipliers.
pub trait Kind<const N: usize, const M: usize, const L: usize>: Copy + Send + Sync {
    /// Moves `places` of inverse masses `w`.
    fn project<T: Number>(self, places: &mut [Vector<T>; N], w: [T; N], rest: [T; M], multipliers: &mut [T; L]);
}

/// Edges keep their lengths. The number is the compliance.
#[derive(Debug, Clone, Copy)]
pub struct Stretch(pub f32);

impl Kind<2, 1, 1> for Stretch {
    #[inline(always)]
    fn project<T: Number>(self, places: &mut [Vector<T>; 2], w: [T; 2], [length]: [T; 1], multipliers: &mut [T; 1]) {
        let step = project_stretch(*places, w, length, length.constant(self.0), multipliers[0]);
        apply(step, places, &mut multipliers[0]);
    }
}

/// The same of edges whose stiffness is shared with others; the second number at rest is their share.
#[derive(Debug, Clone, Copy)]
pub struct PartOfStretch(pub f32);

impl Kind<2, 2, 1> for PartOfStretch {
    #[inline(always)]
    fn project<T: Number>(
        self,
        places: &mut [Vector<T>; 2],
        w: [T; 2],
        [length, share]: [T; 2],
        multipliers: &mut [T; 1],
    ) {
        let step = project_stretch(*places, w, length, length.constant(self.0) / share, multipliers[0]);
        apply(step, places, &mut multipliers[0]);
    }
}

/// Tetrahedra, all alike at rest, keep their volume and their corners' distances to the centre: two constraints on the
/// same particles, one after the other without a way through memory.
#[derive(Debug, Clone, Copy)]
pub struct Flesh {
    /// Volume at rest.
    pub volume: f32,
    /// Distance of the corners to the centre at rest.
    pub arm: f32,
    /// Compliance of the volume, if it is kept.
    pub volume_compliance: Option<f32>,
    /// Compliance of the distances, if they are kept.
    pub energy_compliance: Option<f32>,
}

impl Kind<4, 0, 2> for Flesh {
    #[inline(always)]
    fn project<T: Number>(self, places: &mut [Vector<T>; 4], w: [T; 4], _rest: [T; 0], multipliers: &mut [T; 2]) {
        let any = w[0];
        if let Some(compliance) = self.volume_compliance {
            let constraint = volume(*places, any.constant(self.volume));
            apply(constraint.project(w, any.constant(compliance), multipliers[0]), places, &mut multipliers[0]);
        }
        if let Some(compliance) = self.energy_compliance {
            let arms = [any.constant(self.arm); 4];
            let step = project_energy(*places, w, arms, any.constant(compliance), multipliers[1]);
            apply(step, places, &mut multipliers[1]);
        }
    }
}

/// Tetrahedra below a volume are brought up to it; others are left alone.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fill(pub(super) f32);

impl Kind<4, 0, 0> for Fill {
    #[inline(always)]
    fn project<T: Number>(self, places: &mut [Vector<T>; 4], w: [T; 4], _rest: [T; 0], _multipliers: &mut [T; 0]) {
        let zero = w[0].constant(0.0);
        let Constraint { value, gradient } = volume(*places, w[0].constant(self.0));
        let one_sided = Constraint { value: value.lesser(zero), gradient };
        apply(one_sided.project(w, zero, zero), places, &mut zero.constant(0.0));
    }
}

/// What lies below zero of a measure of `N` particles.
pub(super) trait Measure<const N: usize>: Copy + Send + Sync {
    /// The measure.
    fn of<T: Number>(self, places: [Vector<T>; N], any: T) -> T;
}

/// By how much tetrahedra have more than this volume.
#[derive(Debug, Clone, Copy)]
pub(super) struct Thin(pub(super) f32);

impl Measure<4> for Thin {
    #[inline(always)]
    fn of<T: Number>(self, places: [Vector<T>; 4], any: T) -> T {
        volume(places, any.constant(self.0)).value
    }
}

#[inline(always)]
pub(super) fn apply<T: Number, const N: usize>(
    step: Projection<T, N>,
    places: &mut [Vector<T>; N],
    multiplier: &mut T,
) {
    for n in 0..N {
        places[n] = add(places[n], step.moves[n]);
    }
    *multiplier = *multiplier + step.multiplier;
}
