//! The points that are nearest in position and direction.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::EQUALLY_NEAR;
use super::choice::{Choice, HYSTERESIS, SLACK, cheaper, choose, may_move, near};
use super::price::{blend, cosine, cost};
use crate::adjacency::VertexTriangles;
use crate::surface::{Bound, Priced, SurfacePoint};
use crate::transfer::Source;
use crate::transfer::matching::TargetSurface;
use crate::transfer::matching::ties::{sharing, triangles_around};
use crate::transfer::matching::upright::{self, Side};

/// Normals agree, or are opposite, from this cosine on.
const CLEARLY: f64 = 0.5;

/// What each vertex (V) takes its row from; `closest` (V) are the points nearest in position alone, and `ties` (V) how
/// many other triangles are equally near.
pub(super) fn choices(
    source: &Source,
    target: TargetSurface<'_>,
    closest: &[SurfacePoint],
    ties: &[u32],
) -> Vec<Choice> {
    let around = VertexTriangles::new(target.triangles, target.positions.len());
    let sides = target.triangles.par_iter().with_min_len(1024).map(|t| side(&target, t)).collect();
    let around_source = triangles_around(source);
    let size = source.size();
    let search = Search { source, target, closest, ties, around_source, around, sides, size };
    let all: Vec<u32> = (0..closest.len() as u32).collect();
    let mut choices = search.choices(&all, false);
    let lining = search.lining(&choices);
    for (&i, choice) in std::iter::zip(&lining, search.choices(&lining, true)) {
        choices[i as usize] = choice;
    }
    choices
}

/// What choices are made from.
struct Search<'a> {
    source: &'a Source,
    target: TargetSurface<'a>,
    closest: &'a [SurfacePoint],
    ties: &'a [u32],
    /// The source's triangles around each of its vertices.
    around_source: VertexTriangles,
    /// The triangles around each vertex of the target, and their normals.
    around: VertexTriangles,
    sides: Vec<Option<Vec3>>,
    size: f64,
}

impl Search<'_> {
    /// The points of these vertices; with `both_ways` either direction of their normals will do.
    fn choices(&self, vertices: &[u32], both_ways: bool) -> Vec<Choice> {
        let mut decided: Vec<Result<Choice, Bound>> =
            vertices.par_iter().with_min_len(1024).map(|&i| self.only_choice(i as usize, both_ways)).collect();
        // Few find something clearly cheaper; only for those, all is searched for that costs nearly as little.
        self.decide(vertices, &mut decided, 1.0, both_ways, |i, found| match self.cheaper(i, found) {
            None => Ok(self.choice(i, found)),
            Some(least) => Err(Bound { near: near(self.closest[i].distance, self.size), cost: SLACK * least }),
        });
        self.decide(vertices, &mut decided, SLACK, both_ways, |i, found| Ok(self.choice(i, found)));
        decided
            .into_iter()
            .map(|choice| choice.unwrap_or_else(|_| unreachable!("all have been searched for")))
            .collect()
    }

    /// The closest point if there is no other to choose; where to search if there may be.
    fn only_choice(&self, i: usize, both_ways: bool) -> Result<Choice, Bound> {
        let bound = self.bound(i, both_ways);
        if bound.cost > 0.0 || self.ties[i] != sharing(self.source, &self.around_source, &self.closest[i]) {
            return Err(bound);
        }
        let closest = &self.closest[i];
        Ok(Choice { points: Vec::new(), gap: closest.distance, cosine: self.agreement(i, closest) })
    }

    /// Replaces each bound by what `finish` makes of the points that are cheapest within it, for one of these vertices.
    fn decide(
        &self,
        vertices: &[u32],
        decided: &mut [Result<Choice, Bound>],
        slack: f64,
        both_ways: bool,
        finish: impl Fn(usize, &[Priced]) -> Result<Choice, Bound> + Sync,
    ) {
        let open =
            std::iter::zip(0.., &*decided).filter_map(|(k, choice)| choice.as_ref().err().map(|&bound| (k, bound)));
        let (open, bounds): (Vec<usize>, Vec<Bound>) = open.unzip();
        let at = |k: usize| vertices[open[k]] as usize;
        let queries: Vec<[f32; 3]> = (0..open.len()).map(|k| self.target.positions[at(k)]).collect();
        let cost = |k: usize, point: &SurfacePoint| self.cost(at(k), point, both_ways);
        let index = self.source.index();
        let found = index.cheapest_points(&queries, &bounds, slack, cost, |k, found| finish(at(k), found));
        std::iter::zip(&open, found).for_each(|(&k, choice)| decided[k] = choice);
    }

    fn cost(&self, i: usize, point: &SurfacePoint, both_ways: bool) -> f64 {
        let cosine = cosine(self.source, point, self.target.normals[i]);
        let either = both_ways || self.target.two_sided[i];
        cost(point.distance, if either { cosine.map(f64::abs) } else { cosine }, self.size)
    }

    /// Where the search for something clearly cheaper than the closest point ends.
    fn bound(&self, i: usize, both_ways: bool) -> Bound {
        let point = &self.closest[i];
        let own = self.cost(i, point, both_ways);
        let cost = if may_move(own, point.distance, self.size) { HYSTERESIS * own } else { 0.0 };
        Bound { near: near(self.closest[i].distance, self.size), cost }
    }

    /// The least cost of what was found for vertex `i`, if the nearest points are left for it.
    fn cheaper(&self, i: usize, found: &[Priced]) -> Option<f64> {
        cheaper(found, self.closest[i].distance, self.size).1
    }

    /// What vertex `i` takes of what was found.
    fn choice(&self, i: usize, found: &[Priced]) -> Choice {
        let mut choice = choose(self.source, found, self.closest[i].distance, self.size);
        choice.cosine = match &choice.points[..] {
            [] => self.agreement(i, &self.closest[i]),
            points => points.iter().map(|(point, share)| share * self.agreement(i, point)).sum(),
        };
        choice
    }

    /// Cosine between the source's normal at a point and the direction of vertex `i`, or of a triangle around it, that agrees
    /// best.
    fn agreement(&self, i: usize, point: &SurfacePoint) -> f64 {
        let Some(there) = blend(self.source, point).try_normalize() else { return 1.0 };
        let own = Some(self.target.normals[i]).filter(|&normal| normal != Vec3::ZERO);
        let sides = self.around.around(i).iter().filter_map(|&t| self.sides[t as usize]);
        let cosines = own.into_iter().chain(sides).map(|normal| there.dot(normal.as_dvec3()).abs());
        cosines.reduce(f64::max).map_or(1.0, |cosine| cosine.min(1.0))
    }

    /// The vertices, ascending, that have left a face which looks the other way, but lie in a patch among others that stay on
    /// such faces.
    fn lining(&self, choices: &[Choice]) -> Vec<u32> {
        let has_left = |&i: &u32| {
            let (closest, choice) = (&self.closest[i as usize], &choices[i as usize]);
            choice.gap > closest.distance + 2.0 * EQUALLY_NEAR * self.size
                && !self.target.two_sided[i as usize]
                && self.cosine_of(i as usize, closest) < 0.0
        };
        let n = choices.len() as u32;
        let open: Vec<u32> = (0..n).into_par_iter().with_min_len(1024).filter(has_left).collect();
        if open.is_empty() {
            return open;
        }
        let side = |i: usize| match self.cosine_of(i, &self.closest[i]) {
            cosine if cosine >= CLEARLY => Side::Upright,
            cosine if cosine <= -CLEARLY => Side::Flipped,
            _ => Side::Neither,
        };
        let sides: Vec<Side> = (0..choices.len()).into_par_iter().with_min_len(1024).map(side).collect();
        let is_upright = upright::patches_among_upright(self.target, &open, sides);
        std::iter::zip(open, is_upright).filter_map(|(i, is_upright)| (!is_upright).then_some(i)).collect()
    }

    /// Cosine between the normals of vertex `i` and of a point, 0 where there is none.
    fn cosine_of(&self, i: usize, point: &SurfacePoint) -> f64 {
        cosine(self.source, point, self.target.normals[i]).unwrap_or(0.0)
    }
}

/// Unit normal of a triangle of the target, unless it has none.
fn side(target: &TargetSurface<'_>, triangle: &[u32; 3]) -> Option<Vec3> {
    let [a, b, c] = triangle.map(|i| Vec3::from(target.positions[i as usize]).as_dvec3());
    (b - a).cross(c - a).try_normalize().map(DVec3::as_vec3)
}
