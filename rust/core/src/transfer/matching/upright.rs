//! The face that looks the right way, for vertices that would match one that looks the other way.
//!
//! The inside of a trouser leg often lies nearer to the other thigh than to its own, or even in it. Where a flipped match
//! would take such a vertex to the other limb, the nearest face with an agreeing normal is taken instead. A lining between two
//! limbs looks exactly the same, vertex by vertex; but around such a patch of it all others match flipped, while around
//! that of a trouser leg they match upright. So the vertices around a patch decide for it.

use std::f64::consts::FRAC_PI_2;

use rayon::prelude::*;

use super::{Criteria, TargetSurface, angle};
use crate::adjacency::DisjointSets;
use crate::surface::{Bound, Priced, SurfacePoint};
use crate::transfer::Source;

/// For a vertex in front of the flipped face, an agreeing one is looked for within this many times its distance, or this share
/// of the source's diagonal.
const REACH: (f64, f64) = (4.0, 0.01);

/// The vertices to move and their points: of those whose `closest` point would match flipped, the ones that have a point
/// that looks the right way. Ascending.
pub(super) fn find(
    source: &Source,
    target: TargetSurface<'_>,
    closest: &[SurfacePoint],
    angles: &[f32],
    criteria: &Criteria,
) -> Vec<(u32, SurfacePoint)> {
    if !criteria.match_flipped_normals || criteria.max_normal_angle >= FRAC_PI_2 {
        return Vec::new();
    }
    let is_flipped = |&i: &u32| {
        let (point, angle) = (&closest[i as usize], angles[i as usize]);
        let is_near = point.distance <= criteria.max_distance && criteria.accepts_angle(angle);
        is_near && !criteria.accepts_upright(angle) && !target.two_sided[i as usize]
    };
    let flipped: Vec<u32> = (0..closest.len() as u32).into_par_iter().with_min_len(1024).filter(is_flipped).collect();
    let mut found = agreeing(source, target, closest, criteria, &flipped);
    if found.is_empty() {
        return found;
    }
    let sides: Vec<Side> = (0..closest.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|i| Side::of(closest[i].distance, angles[i], criteria))
        .collect();
    let open: Vec<u32> = found.iter().map(|&(i, _)| i).collect();
    let is_upright = patches_among_upright(target, &open, sides);
    let mut is_upright = is_upright.into_iter();
    found.retain(|_| is_upright.next().expect("one each"));
    found
}

/// How a vertex matches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Side {
    /// Too far away, or neither way clearly.
    Neither,
    /// Its normal agrees with that of its point.
    Upright,
    /// Its normal is opposite to that of its point.
    Flipped,
    /// One of those that an agreeing face was found for.
    Open,
}

impl Side {
    fn of(distance: f64, angle: f32, criteria: &Criteria) -> Self {
        match (distance <= criteria.max_distance, criteria.accepts_upright(angle)) {
            (true, true) => Self::Upright,
            (true, false) if criteria.accepts_angle(angle) => Self::Flipped,
            _ => Self::Neither,
        }
    }
}

/// For each of the vertices `open`, whether more of the vertices around its patch match upright than flipped; `sides` (V) are
/// those of all.
pub(super) fn patches_among_upright(target: TargetSurface<'_>, open: &[u32], mut sides: Vec<Side>) -> Vec<bool> {
    open.iter().for_each(|&i| sides[i as usize] = Side::Open);
    let side = |i: u32| sides[i as usize];
    // Where limbs penetrate deeply, vertices that match neither way lie around the patch.
    let is_open = |i: u32| matches!(side(i), Side::Open | Side::Neither);
    let touching = || target.triangles.iter().filter(|t| t.iter().any(|&i| is_open(i)));
    let mut patches = DisjointSets::new(sides.len());
    for t in touching() {
        let mut open = t.iter().filter(|&&i| is_open(i));
        let first = *open.next().expect("this triangle touches one");
        open.for_each(|&i| patches.union(first, i));
    }
    let mut votes = vec![0i64; sides.len()];
    for t in touching() {
        let open = *t.iter().find(|&&i| is_open(i)).expect("this triangle touches one");
        votes[patches.find(open) as usize] += t.iter().map(|&i| i64::from(side(i) == Side::Upright)).sum::<i64>();
        votes[patches.find(open) as usize] -= t.iter().map(|&i| i64::from(side(i) == Side::Flipped)).sum::<i64>();
    }
    open.iter().map(|&i| votes[patches.find(i) as usize] > 0).collect()
}

/// The nearest point in front of which a vertex lies and whose normal agrees, where there is one within reach.
fn agreeing(
    source: &Source,
    target: TargetSurface<'_>,
    closest: &[SurfacePoint],
    criteria: &Criteria,
    flipped: &[u32],
) -> Vec<(u32, SurfacePoint)> {
    let queries: Vec<[f32; 3]> = flipped.iter().map(|&i| target.positions[i as usize]).collect();
    let reach = |&i: &u32| {
        let reach = (REACH.0 * closest[i as usize].distance).max(REACH.1 * source.diagonal());
        let is_inside = source.is_behind(&closest[i as usize], target.positions[i as usize]);
        let reach = if is_inside { criteria.max_distance } else { reach.min(criteria.max_distance) };
        Bound { near: 0.0, cost: reach * reach }
    };
    let bounds: Vec<Bound> = flipped.par_iter().map(reach).collect();
    let cost = |k: usize, point: &SurfacePoint| {
        let looks_right = criteria.accepts_upright(angle(source, point, target.normals[flipped[k] as usize]));
        let counts = looks_right && !source.is_behind(point, queries[k]);
        if counts { point.distance * point.distance } else { f64::INFINITY }
    };
    let cheapest = source.index().cheapest_points(&queries, &bounds, 1.0, cost, |_, found| nearest(found));
    std::iter::zip(flipped, cheapest).filter_map(|(&i, point)| Some((i, point?))).collect()
}

fn nearest(found: &[Priced]) -> Option<SurfacePoint> {
    let finite = found.iter().filter(|priced| priced.cost.is_finite());
    finite.min_by(|a, b| a.cost.total_cmp(&b.cost)).map(|priced| priced.point)
}
