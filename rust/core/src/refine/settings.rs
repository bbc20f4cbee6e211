//! What can be set, and how much work a frame may take.

use crate::error::{Error, Result};

/// Stiffest that anything may be: beyond it is as hard as single precision tells.
const MOST: f64 = 1e6;

/// The settings of a [`super::Refiner`]; each of the five constraints can be switched off with 0 or false.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Edge of a lattice cell in mesh units; 1.5 % of the bounding box' diagonal if none is given.
    pub cell: Option<f64>,
    /// Stiffness of edges, the inverse of their compliance: 0 off, 1 default.
    pub stretch: f64,
    /// How hard tetrahedra keep their volume: 0 off (and no volume for the whole joint), 1 exactly.
    pub volume: f64,
    /// Farthest that skin may come from its bone, as a multiple of its distance at rest; 0 off.
    pub bind: f64,
    /// Stiffness of the springs between tetrahedra's corners and centres: 0 off.
    pub energy: f64,
    /// Whether skin of neighbouring bones stays on its own side of the plane between them, and limbs apart.
    pub self_collision: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { cell: None, stretch: 1.0, volume: 1.0, bind: 1.08, energy: 0.1, self_collision: true }
    }
}

impl Settings {
    /// # Errors
    /// [`Error::InvalidParameter`] with the first value out of range.
    pub fn check(&self) -> Result<()> {
        let Self { cell, stretch, volume, bind, energy, .. } = *self;
        let checks = [
            ("cell", cell.unwrap_or(1.0), cell.is_none_or(|cell| cell.is_finite() && cell > 0.0), "must be positive"),
            ("stretch", stretch, (0.0..=MOST).contains(&stretch), "must be from 0 to 1e6"),
            ("volume", volume, (0.0..=1.0).contains(&volume), "must be from 0 to 1"),
            ("bind", bind, bind == 0.0 || (1.0..=1000.0).contains(&bind), "must be 0 (off), or from 1 to 1000"),
            ("energy", energy, (0.0..=MOST).contains(&energy), "must be from 0 to 1e6"),
        ];
        match checks.into_iter().find(|check| !check.2) {
            Some((name, value, _, must)) => Err(Error::InvalidParameter { name, value, must }),
            None => Ok(()),
        }
    }
}

/// How much work a frame may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quality {
    /// For the viewport: sub-angles of at most 30 degrees.
    Live,
    /// For what is kept: sub-angles of at most 15 degrees.
    Bake,
}

impl Quality {
    /// Every variant.
    pub const ALL: [Self; 2] = [Self::Live, Self::Bake];

    /// Its name at the boundaries.
    pub fn name(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::Bake => "bake",
        }
    }

    /// The largest sub-angle, radians.
    pub(super) fn sub_angle(self) -> f64 {
        match self {
            Self::Live => 30f64.to_radians(),
            Self::Bake => 15f64.to_radians(),
        }
    }

    /// Iterations in each sub-angle.
    pub(super) fn iterations(self) -> usize {
        2
    }

    /// Passes over the creases at the end.
    pub(super) fn final_passes(self) -> usize {
        match self {
            Self::Live => 6,
            Self::Bake => 10,
        }
    }

    /// Rounds of pushing that may follow on each other where skin has come through skin. A fist takes sixty, most of them in vain.
    pub(super) fn rounds(self) -> usize {
        match self {
            Self::Live => 12,
            Self::Bake => usize::MAX,
        }
    }

    /// Times that the volume is restored and the folds that this makes are taken out.
    pub(super) fn balloons(self) -> usize {
        match self {
            Self::Live => 1,
            Self::Bake => 2,
        }
    }
}
