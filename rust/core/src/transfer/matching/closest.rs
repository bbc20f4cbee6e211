//! The closest point, matched if distance and normal are within thresholds (the paper, section 3.1).

use std::f64::consts::PI;

use rayon::prelude::*;

use super::{Candidates, MaskValue, Matches, TargetSurface, ties};
use crate::fill::Constraint;
use crate::transfer::target::Target;
use crate::transfer::{Length, Settings, Source};

/// A relative distance refers to this.
pub(in crate::transfer) const DISTANCE_REFERENCE: &str =
    "the target's diagonal, or of 30 % of the source's if that is larger";

/// When a vertex matches its closest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Largest distance, world units.
    pub max_distance: f64,
    /// Largest angle between the normals, radians.
    pub max_normal_angle: f64,
    /// Whether a normal that points the opposite way matches too (inner layers, linings).
    pub match_flipped_normals: bool,
    /// Whether a vertex that is equally near to several places takes the mean of those whose normals agree best.
    pub average_ties: bool,
}

impl Criteria {
    pub(in crate::transfer) fn new(settings: &Settings, source: &Source, target: &Target) -> Self {
        Self {
            max_distance: match settings.max_distance {
                Length::Absolute(distance) => distance,
                Length::Relative(share) => share * Self::distance_reference(source, target),
            },
            max_normal_angle: settings.max_normal_angle,
            match_flipped_normals: settings.match_flipped_normals,
            average_ties: settings.average_ties,
        }
    }

    /// What a relative distance refers to, world units: a button is as far from the body as the shirt that it is on.
    pub(in crate::transfer) fn distance_reference(source: &Source, target: &Target) -> f64 {
        target.diagonal.max(0.3 * source.diagonal())
    }

    /// Whether distance and angle of vertex `i` are within the thresholds.
    pub(super) fn accepts(&self, matches: &Matches, i: usize) -> bool {
        let near = matches.points()[i].distance <= self.max_distance;
        near && (matches.is_wire[i] || self.accepts_angle(matches.angles[i]))
    }

    /// Whether normals at this angle agree; NaN never does.
    pub(super) fn accepts_angle(&self, angle: f32) -> bool {
        self.accepts_upright(angle) || self.match_flipped_normals && PI - f64::from(angle) <= self.max_normal_angle
    }

    /// Whether normals at this angle point the same way.
    pub(super) fn accepts_upright(&self, angle: f32) -> bool {
        f64::from(angle) <= self.max_normal_angle
    }
}

/// The closest point of each vertex, several where they tie and that is asked for.
pub(super) fn find(source: &Source, target: TargetSurface<'_>, average_ties: bool) -> Candidates {
    if average_ties {
        ties::find(source, target)
    } else {
        Candidates::one_each(source.index().closest_points(target.positions))
    }
}

/// Matched vertices are fixed, the others free.
pub(super) fn constraints(matches: &Matches, criteria: &Criteria, mask: Option<&[MaskValue]>) -> Vec<Constraint> {
    let is_matched = |i: usize| match mask.map_or(MaskValue::Automatic, |mask| mask[i]) {
        MaskValue::Inpaint => false,
        MaskValue::ForceMatch => matches.weighted[i],
        MaskValue::Automatic => matches.weighted[i] && criteria.accepts(matches, i),
    };
    let constraint = |i| if is_matched(i) { Constraint::Fixed } else { Constraint::Free };
    (0..matches.points().len()).into_par_iter().with_min_len(1024).map(constraint).collect()
}
