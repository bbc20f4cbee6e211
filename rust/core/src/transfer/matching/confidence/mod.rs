//! Every vertex has a row, trusted over a length that grows with its gap and its tilt.
//!
//! A vertex takes the point that is nearest in position and direction: the least `|x - y|^2 + mu^2 |n - n'|^2` over the
//! source's points y, n and n' the unit normals. Its row is trusted over a length h (see [`screened`]). On the skin h vanishes
//! and the row is copied; a hand's breadth away it says only what the wider surroundings should be on average. A crease or a hem
//! is not a tilt: of the directions of the vertex and of the triangles around it, the one that agrees best with the source's
//! counts.
//!
//! The inside of a lining, or of a shell with a thickness, looks to the other limb. Vertices leave a face that looks the other
//! way only if those around their patch agree with theirs (see [`upright`]); in a lining both directions will do.

mod choice;
mod price;
mod search;

use rayon::prelude::*;

use super::{Candidates, MaskValue, Matches, TargetSurface, Terms};
use crate::adjacency::NONE;
use crate::fill::{Constraint, screened};
use crate::transfer::Source;

/// Shares of the source's size: what is a tie of distances, and what is added to each length.
const EQUALLY_NEAR: f64 = 1e-6;
const FLOOR: f64 = 1e-3;
/// Softness relative to the gap where both normals agree.
const GAP: f64 = 0.93;
/// How fast the tangent of the angle between the normals adds to it.
const TILT: f64 = 2.8;
/// Cosines below this count as this.
const LEAST_COSINE: f64 = 0.05;
/// A vertex is held at its row if it is trusted over less than this share of its shortest edge: smoothing over so little
/// changes nothing that the mesh can show.
const HELD: f64 = 0.25;
/// Length, as a share of the source's size, at which a vertex is trusted by half.
const HALF_TRUSTED: f64 = 0.02;

/// What the lengths are made of, (V) each; empty with other methods.
#[derive(Debug, Default)]
pub(super) struct Trust {
    /// Distance to the point that was chosen, world units.
    pub gap: Vec<f64>,
    /// Cosine between the normals there, 0 to 1.
    pub cosine: Vec<f64>,
}

impl Trust {
    /// Lengths h over which the rows are trusted, world units (V).
    pub fn lengths(&self, softness: f64, size: f64) -> Vec<f64> {
        let floor = |gap: f64| (FLOOR * size).min(gap / 2.0) + EQUALLY_NEAR * size;
        let length = |(&gap, &cosine): (&f64, &f64)| softness * growth(gap, cosine) + floor(gap);
        std::iter::zip(&self.gap, &self.cosine).map(length).collect()
    }
}

/// How far a row with length h is trusted, 0 to 1; `size` is the source's.
pub(super) fn confidence(length: f64, size: f64) -> f32 {
    (1.0 / (1.0 + (length / (HALF_TRUSTED * size)).powi(2))) as f32
}

/// The closest point of each vertex, and what it takes its row from instead.
pub(super) fn find(source: &Source, target: TargetSurface<'_>) -> (Candidates, Trust) {
    let (closest, ties) = source.index().closest_points_and_ties(target.positions, EQUALLY_NEAR * source.size());
    let choices = search::choices(source, target, &closest, &ties);
    let (gap, cosine) = choices.par_iter().with_min_len(1024).map(|choice| (choice.gap, choice.cosine)).unzip();
    (Candidates::several(closest, choices.iter().map(|choice| &choice.points[..])), Trust { gap, cosine })
}

/// Gap and tilt as one length, which softness multiplies. Normals that point the opposite way are those of linings, and no tilt.
fn growth(gap: f64, cosine: f64) -> f64 {
    let cosine = cosine.max(LEAST_COSINE);
    gap * (GAP + TILT * (1.0 / (cosine * cosine) - 1.0))
}

/// Soft rows, held where the length is far below the mesh's edges. An island on which the paper's thresholds accept no vertex
/// hangs on the garment instead: a plate over a joint follows the piece it is fastened to.
pub(super) fn constraints(matches: &Matches, terms: &Terms<'_>, mask: Option<&[MaskValue]>) -> Vec<Constraint> {
    let reached = reached_islands(matches, terms, mask);
    let lengths = matches.trust.lengths(terms.softness, matches.source_size);
    let constraint = |i: usize| match mask.map_or(MaskValue::Automatic, |mask| mask[i]) {
        _ if !matches.weighted[i] => Constraint::Free,
        MaskValue::Inpaint => Constraint::Free,
        MaskValue::ForceMatch => Constraint::Fixed,
        MaskValue::Automatic => match terms.fill.islands().of_vertex()[i] {
            NONE => Constraint::Free,
            island if !reached[island as usize] => Constraint::Free,
            _ => soft(terms, i, lengths[i]),
        },
    };
    (0..lengths.len()).into_par_iter().with_min_len(1024).map(constraint).collect()
}

/// Which islands have a vertex that the paper would match, or that the mask forces; all of them if none has, for then there is
/// nothing to hang on.
fn reached_islands(matches: &Matches, terms: &Terms<'_>, mask: Option<&[MaskValue]>) -> Vec<bool> {
    let mut reached = vec![false; terms.fill.islands().count()];
    for (i, &island) in terms.fill.islands().of_vertex().iter().enumerate().filter(|&(_, &island)| island != NONE) {
        let forced = mask.is_some_and(|mask| mask[i] == MaskValue::ForceMatch);
        if !reached[island as usize] && matches.weighted[i] && (forced || terms.criteria.accepts(matches, i)) {
            reached[island as usize] = true;
        }
    }
    if !reached.contains(&true) {
        reached.fill(true);
    }
    reached
}

fn soft(terms: &Terms<'_>, i: usize, length: f64) -> Constraint {
    let (mesh, laplacian) = (terms.fill.mesh(), terms.fill.laplacian());
    let here = mesh.position(i as u32);
    let edges = laplacian.neighbours(i).iter().map(|&j| mesh.position(j).distance(here));
    if length < HELD * edges.fold(f64::INFINITY, f64::min) {
        return Constraint::Fixed;
    }
    Constraint::Soft(screened::confidence(laplacian.mass(i), length))
}
