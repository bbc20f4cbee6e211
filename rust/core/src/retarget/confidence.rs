//! How far a match is to be believed.

use super::Settings;
use super::placed::Placed;
use crate::welded::Welded;

/// Confidence at which a match counts as reliable.
pub(super) const RELIABLE: f64 = 0.5;

/// Confidence of each match (U), 0 to 1: the smallest of three factors that fall through one half at the limits of `settings`
/// for distance, for the angle between the normals, and for how much the edges around the vertex are stretched. `size` is
/// the source's diagonal.
pub(super) fn of_matches(placed: &Placed, target: &Welded, size: f64, settings: &Settings) -> Vec<f64> {
    let stretch = stretches(placed, target);
    let of_one = |u: usize| {
        let angle = placed.matches[u].cosine.clamp(-1.0, 1.0).acos();
        falling(placed.gaps[u], settings.max_distance * size)
            .min(falling(angle, settings.max_normal_angle))
            .min(falling(stretch[u], settings.max_stretch))
    };
    (0..placed.matches.len()).map(of_one).collect()
}

/// 1 at 0, one half at `limit`.
fn falling(x: f64, limit: f64) -> f64 {
    if x <= 0.0 { 1.0 } else { limit * limit / (limit * limit + x * x) }
}

/// By how much the matches of neighbours are farther apart than the neighbours themselves are: the median over a vertex's edges.
/// A single bad neighbour does not spoil a vertex.
fn stretches(placed: &Placed, target: &Welded) -> Vec<f64> {
    let mut ratios = vec![Vec::new(); target.positions.len()];
    let place = |u: u32| (placed.positions[u as usize], placed.matches[u as usize].position);
    for t in &target.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            let ((from_a, to_a), (from_b, to_b)) = (place(a), place(b));
            let length = from_a.distance(from_b);
            if length > 0.0 {
                let ratio = to_a.distance(to_b) / length;
                ratios[a as usize].push(ratio);
                ratios[b as usize].push(ratio);
            }
        }
    }
    let median = |mut ratios: Vec<f64>| {
        let middle = ratios.len() / 2;
        if ratios.is_empty() { 0.0 } else { *ratios.select_nth_unstable_by(middle, f64::total_cmp).1 }
    };
    ratios.into_iter().map(median).collect()
}
