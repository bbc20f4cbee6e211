//! Which of the cheapest points a vertex takes its row from.

use super::EQUALLY_NEAR;
use super::price::DIRECTION;
use crate::surface::{Priced, SurfacePoint};
use crate::transfer::Source;

/// The closest point is left only for one that costs less than this share of its own cost: where little is to be gained,
/// neighbours would choose differently.
pub(super) const HYSTERESIS: f64 = 0.8;
/// Spread of the costs, as a share of the least, that are averaged as a tie; what would count for less than 2 % does not.
const TIE: f64 = 0.3;
/// Points that cost up to this times the least are ties.
pub(super) const SLACK: f64 = 1.0 + 8.0 * TIE * TIE;

/// The point chosen for one vertex, several if they tie; none if it is the closest one.
pub(super) struct Choice {
    pub(super) points: Vec<(SurfacePoint, f64)>,
    pub(super) gap: f64,
    pub(super) cosine: f64,
}

/// Squared distance up to which a point is as near as the closest one, which is at `distance`.
pub(super) fn near(distance: f64, size: f64) -> f64 {
    (distance + EQUALLY_NEAR * size).powi(2)
}

/// Whether a point is within this squared distance.
fn is_near(p: &Priced, near: f64) -> bool {
    p.point.distance * p.point.distance <= near
}

/// Whether a point with this cost can be left: no other costs less than the squared distance of the closest one. Nothing is
/// gained on the skin itself, where both are rounding errors.
pub(super) fn may_move(cost: f64, distance: f64, size: f64) -> bool {
    HYSTERESIS * cost > distance * distance && cost.sqrt() - distance > 1e-3 * DIRECTION * size
}

/// The least cost of the nearest points, and that of all if they are left for it: if others cost clearly less.
pub(super) fn cheaper(found: &[Priced], distance: f64, size: f64) -> (f64, Option<f64>) {
    let (near, mut least_near, mut least) = (near(distance, size), f64::INFINITY, f64::INFINITY);
    for p in found {
        least = least.min(p.cost);
        if is_near(p, near) {
            least_near = least_near.min(p.cost);
        }
    }
    let moves = may_move(least_near, distance, size) && least < HYSTERESIS * least_near;
    (least_near, moves.then_some(least))
}

/// Keeps the nearest points unless others cost clearly less, and averages what ties.
pub(super) fn choose(source: &Source, found: &[Priced], distance: f64, size: f64) -> Choice {
    if let [only] = found {
        return Choice { points: Vec::new(), gap: only.point.distance, cosine: 1.0 };
    }
    let (least_near, least) = cheaper(found, distance, size);
    let (moves, best) = (least.is_some(), least.unwrap_or(least_near));
    let (near, smallest) = (near(distance, size), (EQUALLY_NEAR * size).powi(2));
    let tied = found.iter().filter(|p| (moves || is_near(p, near)) && p.cost <= SLACK * best + smallest);
    let weight =
        |p: &Priced| source.area(p.point.triangle) * (-(p.cost - best) / (2.0 * TIE * TIE * (best + smallest))).exp();
    let weighed: Vec<_> = tied.map(|p| (p.point, weight(p))).collect();
    let sum: f64 = weighed.iter().map(|&(_, weight)| weight).sum();
    let share = |weight: f64| if sum > 0.0 { weight / sum } else { 1.0 / weighed.len() as f64 };
    let gap = weighed.iter().map(|(point, weight)| share(*weight) * point.distance).sum();
    let mut points: Vec<_> = weighed.iter().map(|&(point, weight)| (point, share(weight))).collect();
    if points.windows(2).all(|pair| are_one(source, &pair[0].0, &pair[1].0)) {
        points.truncate(1);
        points.iter_mut().for_each(|(_, share)| *share = 1.0);
    }
    Choice { points, gap, cosine: 1.0 }
}

/// Whether two triangles' points lie on the same corner or side.
fn are_one(source: &Source, first: &SurfacePoint, second: &SurfacePoint) -> bool {
    let support = |point: &SurfacePoint| {
        let corners = source.triangles()[point.triangle as usize];
        let mut support: Vec<(u32, f64)> =
            std::iter::zip(corners, point.barycentric).filter(|&(_, share)| share > 1e-6).collect();
        support.sort_unstable_by_key(|&(i, _)| i);
        support
    };
    let (first, second) = (support(first), support(second));
    first.len() == second.len() && std::iter::zip(first, second).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-6)
}
