//! The face that looks the right way, for vertices that would match one that looks the other way.
//!
//! The inside of a trouser leg often lies nearer to the other thigh than to its own, or even in it. Where a flipped match
//! would take such a vertex to the other limb, the nearest face with an agreeing normal is taken instead. A lining does have
//! its own limb's face nearest, flipped: what it would be taken to lies beyond the garment's outer layer.

use std::f64::consts::FRAC_PI_2;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Criteria, TargetSurface, angle};
use crate::mesh::TriMesh;
use crate::surface::{Bound, Priced, SurfaceIndex, SurfacePoint};
use crate::transfer::Source;

/// For a vertex in front of the flipped face, an agreeing one is looked for within this many times its distance, or this share
/// of the source's diagonal.
const REACH: (f64, f64) = (4.0, 0.01);

/// The vertices to move and their points: of those whose `closest` point would match flipped, the ones that see a point
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
    let is_inside = |i: u32| source.is_behind(&closest[i as usize], target.positions[i as usize]);
    let mut found = agreeing(source, target, closest, criteria, &flipped, &is_inside);
    let seen = sees(source, target, &found, &is_inside);
    let mut seen = seen.into_iter();
    found.retain(|_| seen.next().expect("one each"));
    found
}

/// The nearest point in front of which a vertex lies and whose normal agrees, where there is one within reach.
fn agreeing(
    source: &Source,
    target: TargetSurface<'_>,
    closest: &[SurfacePoint],
    criteria: &Criteria,
    flipped: &[u32],
    is_inside: &(impl Fn(u32) -> bool + Sync),
) -> Vec<(u32, SurfacePoint)> {
    let queries: Vec<[f32; 3]> = flipped.iter().map(|&i| target.positions[i as usize]).collect();
    let reach = |&i: &u32| {
        let reach = (REACH.0 * closest[i as usize].distance).max(REACH.1 * source.diagonal());
        let reach = if is_inside(i) { criteria.max_distance } else { reach.min(criteria.max_distance) };
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

/// Whether no layer of the target lies between a vertex and the point found for it. A vertex inside the body is not asked.
fn sees(
    source: &Source,
    target: TargetSurface<'_>,
    found: &[(u32, SurfacePoint)],
    is_inside: &(impl Fn(u32) -> bool + Sync),
) -> Vec<bool> {
    let asked: Vec<bool> = found.par_iter().map(|&(i, _)| !is_inside(i)).collect();
    if !asked.contains(&true) {
        return vec![true; found.len()];
    }
    let mesh = TriMesh::of_checked(target.positions, target.triangles);
    let index = SurfaceIndex::new(&mesh);
    let ends = |(i, point): &(u32, SurfacePoint)| {
        (Vec3::from(target.positions[*i as usize]).as_dvec3(), source.position(point))
    };
    let middles: Vec<[f32; 3]> = found.iter().map(ends).map(|(a, b)| a.midpoint(b).as_vec3().to_array()).collect();
    let bound = |(is_asked, point): (&bool, &(u32, SurfacePoint))| {
        // The ball around the segment, a shade larger than rounding needs.
        let radius = if *is_asked { 0.51 * point.1.distance } else { 0.0 };
        Bound { near: 0.0, cost: radius * radius }
    };
    let bounds: Vec<Bound> = std::iter::zip(&asked, found).map(bound).collect();
    let cost = |k: usize, point: &SurfacePoint| {
        let triangle = target.triangles[point.triangle as usize];
        let (a, b) = ends(&found[k]);
        let crosses = !triangle.contains(&found[k].0) && crosses(a, b, triangle.map(|i| mesh.position(i)));
        if crosses { point.distance * point.distance } else { f64::INFINITY }
    };
    let is_crossed = index.cheapest_points(&middles, &bounds, 1.0, cost, |_, found| nearest(found).is_some());
    std::iter::zip(asked, is_crossed).map(|(is_asked, is_crossed)| !(is_asked && is_crossed)).collect()
}

/// Whether the segment from `a` to `b` goes through the triangle (Möller and Trumbore 1997).
fn crosses(a: DVec3, b: DVec3, [p, q, r]: [DVec3; 3]) -> bool {
    let (direction, pq, pr) = (b - a, q - p, r - p);
    let normal = direction.cross(pr);
    let determinant = pq.dot(normal);
    if determinant == 0.0 {
        return false;
    }
    let from_p = a - p;
    let u = from_p.dot(normal) / determinant;
    let across = from_p.cross(pq);
    let v = direction.dot(across) / determinant;
    let along = pr.dot(across) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=1.0).contains(&along)
}
