//! Detail of the source's weights that a garment keeps even where it is smoothed.
//!
//! Smoothing over the width of a gap would blur the changes at elbows and knees as well. Where two neighbours' points lie on the
//! source as the neighbours themselves lie to each other, the change of weight between them is the source's own and is kept;
//! where the points lie apart, as on two legs, or the surfaces tilt, or the change is so steep that the cloth would tear there,
//! it is an accident of matching and is not.

use glam::DVec3;
use rayon::prelude::*;

use super::Source;
use super::matching::Matches;
use crate::fill::{Constraint, Fill, Ragged, RowTable};

/// Share of a trusted change that is kept at most; all of it would keep more torn edges as well.
const KEPT: f64 = 0.85;
/// Stretch of an edge on the source, beyond its own length, at which its change is trusted by half.
const STRETCH: f64 = 0.5;
/// Power of the cosine between the normals.
const TILT: i32 = 4;
/// Gap, as a share of the source's size, at which it is trusted by half.
const GAP: f64 = 0.05;
/// Change of weight over the source's size at which it is trusted by half: a bend of a limb tears edges that are steeper.
const STEEP: f64 = 25.0;

/// What a vertex's point says of the edges around it.
struct Place {
    /// On the source, world space.
    point: DVec3,
    gap: f64,
    cosine: f64,
}

impl Place {
    /// Trust, 0 to 1, in the change of weight along an edge of this `length` between two vertices.
    fn trust(&self, other: &Self, length: f64, source_size: f64) -> f64 {
        let stretch = self.point.distance(other.point) / length.max(f64::MIN_POSITIVE);
        let excess = ((stretch - 1.0).max(0.0) / STRETCH).powi(2);
        let gap = (self.gap.max(other.gap) / (GAP * source_size)).powi(4);
        KEPT * self.cosine.min(other.cosine).powi(TILT) / ((1.0 + excess) * (1.0 + gap))
    }
}

/// Share of the change along each edge that is kept, in the order of the Laplacian's rows, (V); of two soft vertices the one
/// with the lower index has it, and the other has 0. `rows` are the source's, empty where none is asked for; only soft
/// vertices keep anything.
pub(super) fn kept(
    source: &Source,
    matches: &Matches,
    fill: &Fill,
    constraints: &[Constraint],
    rows: &RowTable,
) -> Ragged<f64> {
    let place = |i: usize| {
        if rows.of(i).is_empty() {
            // Nobody asks for its edges.
            return Place { point: DVec3::ZERO, gap: 0.0, cosine: 0.0 };
        }
        let (point, (gap, cosine)) = (matches.mean_position(source, i), matches.gap_and_cosine(i));
        Place { point, gap, cosine }
    };
    let places: Vec<Place> = (0..constraints.len()).into_par_iter().with_min_len(512).map(place).collect();
    let (mesh, laplacian) = (fill.mesh(), fill.laplacian());
    Ragged::new(constraints.len(), |i, shares| {
        let Constraint::Soft(_) = constraints[i] else { return };
        let here = mesh.position(i as u32);
        shares.extend(laplacian.neighbours(i).iter().map(|&j| {
            if (j as usize) < i && matches!(constraints[j as usize], Constraint::Soft(_)) {
                return 0.0;
            }
            let length = here.distance(mesh.position(j));
            let steepness = half_l1(rows.of(i), rows.of(j as usize)) * source.size() / length.max(f64::MIN_POSITIVE);
            places[i].trust(&places[j as usize], length, source.size()) / (1.0 + (steepness / STEEP).powi(2))
        }));
    })
}

/// Half the L1 distance of two rows that sum to one: what either has more than the other.
fn half_l1(first: &[(u32, f64)], second: &[(u32, f64)]) -> f64 {
    let (mut at, mut more) = (0, 0.0);
    for &(column, value) in first {
        while at < second.len() && second[at].0 < column {
            at += 1;
        }
        let shared = second.get(at).filter(|&&(other, _)| other == column).map_or(0.0, |&(_, value)| value);
        more += (value - shared).max(0.0);
    }
    more
}
