//! Who is matched, who is unknown, and which lengths are in force.

use super::{Criteria, Inpainting, Length, MaskValue, Settings};
use crate::adjacency::NONE;
use crate::error::{Error, Result};

/// Unknowns and lengths of one solve.
pub(super) struct Problem {
    pub criteria: Criteria,
    pub smoothness_length: f64,
    pub matched: Vec<bool>,
    /// Whether each island holds a match.
    pub has_match: Vec<bool>,
    /// Unmatched vertices of islands that hold a match.
    pub unknown: Vec<bool>,
}

impl Problem {
    /// Decides who is matched, unknown, or on an island without a match.
    pub fn new(target: &Inpainting, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Self> {
        let matched = target.matched(mask, settings)?;
        let criteria = target.criteria(settings);
        let of_vertex = target.islands.of_vertex();
        let mut has_match = vec![false; target.islands.count()];
        for (&island, _) in std::iter::zip(of_vertex, &matched).filter(|&(&island, &m)| m && island != NONE) {
            has_match[island as usize] = true;
        }
        if !has_match.contains(&true) {
            return Err(nothing_matched(target, &criteria, mask, settings));
        }
        let is_unknown = |(&island, &m): (&u32, &bool)| !m && island != NONE && has_match[island as usize];
        let unknown = std::iter::zip(of_vertex, &matched).map(is_unknown).collect();
        let smoothness_length = settings.smoothness_length.of(target.source.diagonal());
        Ok(Self { criteria, smoothness_length, matched, has_match, unknown })
    }
}

fn nothing_matched(target: &Inpainting, criteria: &Criteria, mask: Option<&[MaskValue]>, settings: &Settings) -> Error {
    let needed = target.closest.smallest_matching_distance(criteria, mask);
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
