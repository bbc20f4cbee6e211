//! Vertices that are equally near to several places, as those in the middle of a symmetric body are: between its legs, say.
//!
//! Whichever place came first would give such a vertex the weights of one side. It takes the mean instead, of the places whose
//! normals agree with its own best.

use rayon::prelude::*;

use super::{Candidates, TargetSurface};
use crate::adjacency::VertexTriangles;
use crate::surface::{Bound, Priced, SurfacePoint};
use crate::transfer::Source;

/// Squared distances are equal if they differ by less than this share.
const TIE: f64 = 2e-9;
/// Places closer together than this share of their distance are one.
const ONE_PLACE: f64 = 0.01;
/// Angles between normals that differ by less are equal, radians.
const SAME_ANGLE: f32 = 1e-3;
/// On the surface itself, closer than this share of the source's size, there is one place only.
const ON_SURFACE: f64 = 1e-6;
/// Barycentric coordinates below this are zero.
const ZERO: f64 = 1e-9;

/// The closest points of all vertices.
pub(super) fn find(source: &Source, target: TargetSurface<'_>) -> Candidates {
    let (mut first, ties) = source.index().closest_points_and_ties(target.positions, 0.0);
    let around = triangles_around(source);
    let on_surface = ON_SURFACE * source.size();
    let is_open = |&i: &u32| {
        let (point, ties) = (&first[i as usize], ties[i as usize]);
        ties > 0 && point.distance > on_surface && ties != sharing(source, &around, point)
    };
    let open: Vec<u32> = (0..first.len() as u32).into_par_iter().with_min_len(1024).filter(is_open).collect();
    if open.is_empty() {
        return Candidates::one_each(first);
    }
    let tied = places(source, target, &first, &open);
    let mut several = vec![Vec::new(); first.len()];
    for (&i, places) in std::iter::zip(&open, tied) {
        first[i as usize] = places[0].0;
        if places.len() > 1 {
            several[i as usize] = places;
        }
    }
    Candidates::several(first, several.iter().map(Vec::as_slice))
}

/// The source's triangles around each of its vertices.
pub(super) fn triangles_around(source: &Source) -> VertexTriangles {
    let count = source.triangles().iter().flatten().max().map_or(0, |&most| most as usize + 1);
    VertexTriangles::new(source.triangles(), count)
}

/// How many other triangles share a point on the source, as they share its corner or edge.
pub(super) fn sharing(source: &Source, around: &VertexTriangles, point: &SurfacePoint) -> u32 {
    let corners = source.triangles()[point.triangle as usize];
    let is_there = |&k: &usize| point.barycentric[k] > ZERO;
    let mut inside = (0..3).filter(is_there).map(|k| corners[k]);
    let with = |i: u32, j: u32| {
        around.around(i as usize).iter().filter(|&&t| source.triangles()[t as usize].contains(&j)).count()
    };
    let all = match (inside.next(), inside.next(), inside.next()) {
        (Some(i), Some(j), None) => with(i, j),
        (Some(i), None, None) => with(i, i),
        _ => 1,
    };
    all as u32 - 1
}

/// The places that each vertex of `open` takes its row from, with shares; one at least.
fn places(
    source: &Source,
    target: TargetSurface<'_>,
    closest: &[SurfacePoint],
    open: &[u32],
) -> Vec<Vec<(SurfacePoint, f64)>> {
    let queries: Vec<[f32; 3]> = open.iter().map(|&i| target.positions[i as usize]).collect();
    let bound = |&i: &u32| Bound { near: closest[i as usize].distance.powi(2) * (1.0 + TIE), cost: 0.0 };
    let bounds: Vec<Bound> = open.iter().map(bound).collect();
    let finish = |k: usize, found: &[Priced]| {
        let i = open[k] as usize;
        agreeing(source, target, i, &distinct(source, closest[i], found))
    };
    let squared = |_: usize, point: &SurfacePoint| point.distance * point.distance;
    source.index().cheapest_points(&queries, &bounds, 1.0, squared, finish)
}

/// The closest point and those found elsewhere, one for each place.
fn distinct(source: &Source, closest: SurfacePoint, found: &[Priced]) -> Vec<SurfacePoint> {
    let apart = ONE_PLACE * closest.distance;
    let mut places = vec![closest];
    for Priced { point, .. } in found {
        let position = source.position(point);
        if places.iter().all(|other| source.position(other).distance(position) > apart) {
            places.push(*point);
        }
    }
    places
}

/// Those whose normals agree best with that of vertex `i`, each with the same share.
fn agreeing(source: &Source, target: TargetSurface<'_>, i: usize, places: &[SurfacePoint]) -> Vec<(SurfacePoint, f64)> {
    let angles: Vec<f32> = places.iter().map(|point| target.angle(source, i, point)).collect();
    let least = angles.iter().copied().fold(f32::INFINITY, f32::min);
    let agrees = |angle: f32| least.is_infinite() || angle <= least + SAME_ANGLE;
    let kept: Vec<SurfacePoint> =
        std::iter::zip(places, &angles).filter(|&(_, &angle)| agrees(angle)).map(|(&point, _)| point).collect();
    let share = 1.0 / kept.len() as f64;
    kept.into_iter().map(|point| (point, share)).collect()
}
