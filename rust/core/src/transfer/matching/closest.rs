//! The closest point, matched if distance and normal are within thresholds (the paper, section 3.1).

use rayon::prelude::*;

use super::{Candidates, MaskValue, Matches, TargetSurface};
use crate::fill::Constraint;
use crate::transfer::Source;

/// When a vertex matches its closest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Largest distance, world units.
    pub max_distance: f64,
    /// Largest angle between the normals, radians.
    pub max_normal_angle: f64,
    /// Whether a normal that points the opposite way matches too (inner layers, linings).
    pub match_flipped_normals: bool,
}

impl Criteria {
    /// Whether distance and angle of vertex `i` are within the thresholds.
    pub(super) fn accepts(&self, matches: &Matches, i: usize) -> bool {
        matches.points()[i].distance <= self.max_distance && self.accepts_angle(matches.angles[i])
    }

    /// Whether normals at this angle agree; NaN never does.
    fn accepts_angle(&self, angle: f32) -> bool {
        let angle = f64::from(angle);
        let flipped = self.match_flipped_normals && std::f64::consts::PI - angle <= self.max_normal_angle;
        angle <= self.max_normal_angle || flipped
    }
}

/// The closest point of each vertex.
pub(super) fn find(source: &Source, target: TargetSurface<'_>) -> Candidates {
    Candidates::one_each(source.index().closest_points(target.positions))
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
