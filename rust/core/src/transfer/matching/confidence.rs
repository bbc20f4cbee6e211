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

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::upright::{self, Side};
use super::{Candidates, MaskValue, Matches, TargetSurface, Terms};
use crate::adjacency::{NONE, VertexTriangles};
use crate::fill::{Constraint, screened};
use crate::surface::{Bound, Priced, SurfacePoint};
use crate::transfer::Source;

/// mu: opposite normals cost as much as a distance of twice this share of the source's size.
const DIRECTION: f64 = 0.015;
/// The closest point is left only for one that costs less than this share of its own cost: where little is to be gained,
/// neighbours would choose differently.
const HYSTERESIS: f64 = 0.8;
/// Spread of the costs, as a share of the least, that are averaged as a tie; what would count for less than 2 % does not.
const TIE: f64 = 0.3;
const SLACK: f64 = 1.0 + 8.0 * TIE * TIE;
/// Shares of the source's size: what is a tie of distances, and what is added to each length.
const EQUALLY_NEAR: f64 = 1e-6;
const FLOOR: f64 = 1e-3;
/// Softness relative to the gap where both normals agree.
const GAP: f64 = 0.93;
/// How fast the tangent of the angle between the normals adds to it.
const TILT: f64 = 2.8;
/// Cosines below this count as this.
const LEAST_COSINE: f64 = 0.05;
/// Normals agree, or are opposite, from this cosine on.
const CLEARLY: f64 = 0.5;
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

/// The point chosen for one vertex, several if they tie; none if it is the closest one.
struct Choice {
    points: Vec<(SurfacePoint, f64)>,
    gap: f64,
    cosine: f64,
}

/// The closest point of each vertex, and what it takes its row from instead.
pub(super) fn find(source: &Source, target: TargetSurface<'_>) -> (Candidates, Trust) {
    let closest = source.index().closest_points(target.positions);
    let around = VertexTriangles::new(target.triangles, target.positions.len());
    let sides = target.triangles.par_iter().with_min_len(1024).map(|t| side(&target, t)).collect();
    let search = Search { source, target, closest: &closest, around: &around, sides, size: source.size() };
    let all: Vec<u32> = (0..closest.len() as u32).collect();
    let mut choices = search.choices(&all, false);
    let lining = search.lining(&choices);
    for (&i, choice) in std::iter::zip(&lining, search.choices(&lining, true)) {
        choices[i as usize] = choice;
    }
    let gap: Vec<f64> = choices.iter().map(|choice| choice.gap).collect();
    let cosine = choices.iter().map(|choice| choice.cosine).collect();
    let all: Vec<_> = choices.into_iter().map(|choice| choice.points).collect();
    (Candidates::several(closest, &all), Trust { gap, cosine })
}

/// What choices are made from; `closest` (V) are the points nearest in position alone, `sides` (T) the triangles' normals.
struct Search<'a> {
    source: &'a Source,
    target: TargetSurface<'a>,
    closest: &'a [SurfacePoint],
    around: &'a VertexTriangles,
    sides: Vec<Option<Vec3>>,
    size: f64,
}

impl Search<'_> {
    /// The points of these vertices; with `both_ways` either direction of their normals will do.
    fn choices(&self, vertices: &[u32], both_ways: bool) -> Vec<Choice> {
        // Most find nothing clearly cheaper; only for those that do, all is searched for that costs nearly as little.
        let bounds = vertices.par_iter().with_min_len(1024).map(|&i| self.bound(i as usize, both_ways)).collect();
        let decide = |i: usize, found: &[Priced]| match self.cheaper(i, found) {
            None => Ok(self.choice(i, found)),
            Some(least) => Err(Bound { near: self.near(i), cost: SLACK * least }),
        };
        let mut decided = self.cheapest(vertices, bounds, 1.0, both_ways, decide);
        let moving =
            decided.iter().enumerate().filter_map(|(k, choice)| choice.as_ref().err().map(|&bound| (k, bound)));
        let (moving, bounds): (Vec<usize>, Vec<Bound>) = moving.unzip();
        let again: Vec<u32> = moving.iter().map(|&k| vertices[k]).collect();
        let moved = self.cheapest(&again, bounds, SLACK, both_ways, |i, found| self.choice(i, found));
        std::iter::zip(moving, moved).for_each(|(k, choice)| decided[k] = Ok(choice));
        decided.into_iter().map(|choice| choice.unwrap_or_else(|_| unreachable!("it was searched for again"))).collect()
    }

    /// What `finish` makes of the cheapest points of these vertices, which it is told.
    fn cheapest<T: Send>(
        &self,
        vertices: &[u32],
        bounds: Vec<Bound>,
        slack: f64,
        both_ways: bool,
        finish: impl Fn(usize, &[Priced]) -> T + Sync,
    ) -> Vec<T> {
        let at = |k: usize| vertices[k] as usize;
        let queries: Vec<[f32; 3]> = vertices.iter().map(|&i| self.target.positions[i as usize]).collect();
        let cost = |k: usize, point: &SurfacePoint| self.cost(at(k), point, both_ways);
        self.source.index().cheapest_points(&queries, &bounds, slack, cost, |k, found| finish(at(k), found))
    }

    fn cost(&self, i: usize, point: &SurfacePoint, both_ways: bool) -> f64 {
        let cosine = cosine(self.source, point, self.target.normals[i]);
        let either = both_ways || self.target.two_sided[i];
        cost(point.distance, if either { cosine.map(f64::abs) } else { cosine }, self.size)
    }

    /// Squared distance within which everything is as near to vertex `i` as its closest point.
    fn near(&self, i: usize) -> f64 {
        (self.closest[i].distance + EQUALLY_NEAR * self.size).powi(2)
    }

    /// Where the search for something clearly cheaper than the closest point ends.
    fn bound(&self, i: usize, both_ways: bool) -> Bound {
        let point = &self.closest[i];
        let own = self.cost(i, point, both_ways);
        let cost = if may_move(own, point.distance, self.size) { HYSTERESIS * own } else { 0.0 };
        Bound { near: self.near(i), cost }
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

/// Cost of a point at a distance whose normal has a cosine with the vertex's; without a normal only distance counts.
fn cost(distance: f64, cosine: Option<f64>, size: f64) -> f64 {
    let direction = DIRECTION * size;
    distance * distance + 2.0 * direction * direction * (1.0 - cosine.unwrap_or(1.0))
}

/// Cosine between a vertex's normal and the source's normal at `point`, None where either has no length.
fn cosine(source: &Source, point: &SurfacePoint, normal: Vec3) -> Option<f64> {
    between(blend(source, point), normal)
}

/// The source's normal at `point`, of any length.
fn blend(source: &Source, point: &SurfacePoint) -> DVec3 {
    let corners = source.triangles()[point.triangle as usize];
    let normals = corners.map(|i| source.normals()[i as usize].as_dvec3());
    std::iter::zip(normals, point.barycentric).map(|(normal, share)| normal * share).sum()
}

/// Cosine between two directions, None where either has no length.
fn between(blend: DVec3, normal: Vec3) -> Option<f64> {
    let normal = normal.as_dvec3();
    let lengths = blend.length() * normal.length();
    (lengths > 0.0).then(|| (blend.dot(normal) / lengths).clamp(-1.0, 1.0))
}

/// Whether a point with this cost can be left: no other costs less than the squared distance of the closest one. Nothing is
/// gained on the skin itself, where both are rounding errors.
fn may_move(cost: f64, distance: f64, size: f64) -> bool {
    HYSTERESIS * cost > distance * distance && cost.sqrt() - distance > 1e-3 * DIRECTION * size
}

/// Unit normal of a triangle of the target, unless it has none.
fn side(target: &TargetSurface<'_>, triangle: &[u32; 3]) -> Option<Vec3> {
    let [a, b, c] = triangle.map(|i| Vec3::from(target.positions[i as usize]).as_dvec3());
    (b - a).cross(c - a).try_normalize().map(DVec3::as_vec3)
}

/// Whether a point is as near as the closest one, at this distance.
fn is_near(p: &Priced, distance: f64, size: f64) -> bool {
    p.point.distance * p.point.distance <= (distance + EQUALLY_NEAR * size).powi(2)
}

/// The least cost of the nearest points, and that of all if they are left for it: if others cost clearly less.
fn cheaper(found: &[Priced], distance: f64, size: f64) -> (f64, Option<f64>) {
    let (mut least_near, mut least) = (f64::INFINITY, f64::INFINITY);
    for p in found {
        least = least.min(p.cost);
        if is_near(p, distance, size) {
            least_near = least_near.min(p.cost);
        }
    }
    let moves = may_move(least_near, distance, size) && least < HYSTERESIS * least_near;
    (least_near, moves.then_some(least))
}

/// Keeps the nearest points unless others cost clearly less, and averages what ties.
fn choose(source: &Source, found: &[Priced], distance: f64, size: f64) -> Choice {
    if let [only] = found {
        return Choice { points: Vec::new(), gap: only.point.distance, cosine: 1.0 };
    }
    let (least_near, least) = cheaper(found, distance, size);
    let (moves, best) = (least.is_some(), least.unwrap_or(least_near));
    let smallest = (EQUALLY_NEAR * size).powi(2);
    let tied = found.iter().filter(|p| (moves || is_near(p, distance, size)) && p.cost <= SLACK * best + smallest);
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
