//! What the artist can set.

use super::{IslandPolicy, MatchMethod, SmallIslands};
use crate::error::{Error, Result};

/// A length, in world units or as a share of a bounding-box diagonal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Length {
    /// World units.
    Absolute(f64),
    /// Share of the diagonal that the parameter names.
    Relative(f64),
}

impl Length {
    pub(super) fn of(self, diagonal: f64) -> f64 {
        match self {
            Self::Absolute(length) => length,
            Self::Relative(share) => share * diagonal,
        }
    }

    fn check(self, name: &'static str) -> Result<()> {
        let (Self::Absolute(value) | Self::Relative(value)) = self;
        check_range(name, value, value >= 0.0, "must be a finite number, 0 or more")
    }
}

/// Everything the artist can set. The defaults suit garments on a person, in any unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// How matching points are found. Default [`MatchMethod::ClosestPoint`].
    pub method: MatchMethod,
    /// How soft [`MatchMethod::Confidence`] is: the length over which a row is trusted, as a multiple of the gap to the source.
    /// Default 0.7; 0.35 to 1.4 are useful.
    pub softness: f64,
    /// Largest distance of a match; relative to the target's diagonal, or to 30 % of the source's if that is larger. Default
    /// 0.05 relative.
    pub max_distance: Length,
    /// Vertices no farther apart than this are one; relative to the target's diagonal, 0 for none. Default 1e-6 relative.
    pub weld_tolerance: Length,
    /// Largest angle between normals of a match, radians. Default 35 degrees.
    pub max_normal_angle: f64,
    /// Whether opposite normals match too. Default true.
    pub match_flipped_normals: bool,
    /// Whether a vertex that is equally near to several places takes the mean of those whose normals agree best, as
    /// symmetry asks for in the middle of a body, instead of the first triangle's row. Default false.
    pub average_ties: bool,
    /// l of the energy S + l^2 S M^-1 S; relative to the source's diagonal. 0 gives the harmonic solution. Default
    /// 0.05 relative.
    pub smoothness_length: Length,
    /// Jacobi passes after the solve. Default 0.
    pub smoothing_iterations: u32,
    /// Share of the neighbours' mean in each pass, 0 to 1. Default 0.2.
    pub smoothing_factor: f64,
    /// Most influences a vertex may keep, 0 for no limit. Default 0.
    pub max_influences: usize,
    /// What islands without a match get. Default [`IslandPolicy::Bridge`].
    pub island_policy: IslandPolicy,
    /// What small loose parts become. Default [`SmallIslands::Auto`].
    pub small_islands: SmallIslands,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: MatchMethod::ClosestPoint,
            softness: 0.7,
            max_distance: Length::Relative(0.05),
            weld_tolerance: Length::Relative(1e-6),
            max_normal_angle: 35f64.to_radians(),
            match_flipped_normals: true,
            average_ties: false,
            smoothness_length: Length::Relative(0.05),
            smoothing_iterations: 0,
            smoothing_factor: 0.2,
            max_influences: 0,
            island_policy: IslandPolicy::Bridge,
            small_islands: SmallIslands::Auto,
        }
    }
}

impl Settings {
    /// Whether small, loose, nearly rigid islands become rigid.
    pub(super) fn stiffens(&self) -> bool {
        match self.small_islands {
            SmallIslands::Auto => self.method == MatchMethod::Confidence,
            SmallIslands::Rigid => true,
            SmallIslands::Solved => false,
        }
    }

    /// # Errors
    /// [`Error::InvalidParameter`] for the first value out of range.
    pub fn check(&self) -> Result<()> {
        self.max_distance.check("max_distance")?;
        self.weld_tolerance.check("weld_tolerance")?;
        self.smoothness_length.check("smoothness_length")?;
        let softness = self.softness;
        check_range("softness", softness, softness > 0.0, "must be a number above 0")?;
        let (angle, factor) = (self.max_normal_angle, self.smoothing_factor);
        check_range("max_normal_angle", angle, angle >= 0.0, "must be an angle in radians, 0 or more")?;
        check_range("smoothing_factor", factor, (0.0..=1.0).contains(&factor), "must lie between 0 and 1")
    }
}

fn check_range(name: &'static str, value: f64, inside: bool, must: &'static str) -> Result<()> {
    if inside && value.is_finite() { Ok(()) } else { Err(Error::InvalidParameter { name, value, must }) }
}
