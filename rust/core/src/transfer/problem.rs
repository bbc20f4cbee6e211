//! What is known of each vertex, and which lengths are in force.

use super::{Criteria, Inpainting, Length, MaskValue, Settings};
use crate::adjacency::NONE;
use crate::error::{Error, Result};
use crate::fill::Constraint;

/// Constraints and lengths of one solve.
pub(super) struct Problem {
    pub criteria: Criteria,
    pub smoothness_length: f64,
    /// What is known of each vertex, (V).
    pub constraints: Vec<Constraint>,
    /// Whether anything is known on each island.
    pub has_match: Vec<bool>,
}

impl Problem {
    /// Decides what is known, and which islands hang on nothing.
    pub fn new(target: &Inpainting, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Self> {
        let constraints = target.constraints(mask, settings)?;
        let criteria = target.criteria(settings);
        let of_vertex = target.islands().of_vertex();
        let mut has_match = vec![false; target.islands().count()];
        let known = std::iter::zip(of_vertex, &constraints);
        for (&island, _) in known.filter(|&(&island, c)| island != NONE && c.is_known()) {
            has_match[island as usize] = true;
        }
        if !has_match.contains(&true) {
            return Err(nothing_matched(target, &criteria, mask, settings));
        }
        let smoothness_length = target.smoothness_length(settings);
        Ok(Self { criteria, smoothness_length, constraints, has_match })
    }
}

fn nothing_matched(target: &Inpainting, criteria: &Criteria, mask: Option<&[MaskValue]>, settings: &Settings) -> Error {
    let needed = target.matches.smallest_matching_distance(criteria, mask);
    let relative = |needed: f64| match settings.max_distance {
        Length::Relative(_) => format!(" ({:.4} of the target's diagonal)", needed / target.diagonal),
        Length::Absolute(_) => String::new(),
    };
    let advice = match needed {
        Some(needed) => format!("the smallest distance that matches something is {needed:.6}{}", relative(needed)),
        None => "no distance would help: check the mask, the largest normal angle and the source's weights".into(),
    };
    Error::NothingMatched { max_distance: criteria.max_distance, needed, advice }
}
