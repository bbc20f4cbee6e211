//! Pairs of triangles that pass through each other.

use glam::{DVec3, Vec3, Vec3A};
use rayon::prelude::*;

use super::morton::morton;

/// Boxes in a group, and groups in a larger one.
const WIDE: usize = 8;
/// Groups that one task compares with all others.
const RUN: usize = 16;
/// Steps of the Morton curve's grid along the longest side.
const STEPS: f32 = (1 << 20) as f32;

/// Every pair of triangles that intersect and share no corner, each once, ascending.
pub fn intersecting_pairs(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let places: Vec<Vec3> = positions.iter().map(|&p| p.into()).collect();
    let centre = |t: &[u32; 3]| t.map(|i| places[i as usize]).iter().sum::<Vec3>() / 3.0;
    let low = places.iter().fold(Vec3::INFINITY, |low, &p| low.min(p));
    let high = places.iter().fold(Vec3::NEG_INFINITY, |high, &p| high.max(p));
    let scale = STEPS / (high - low).max_element().max(f32::MIN_POSITIVE);
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    order.sort_by_cached_key(|&t| (morton(((centre(&triangles[t as usize]) - low) * scale).as_ivec3().to_array()), t));
    intersecting_pairs_of(&places, triangles, &order)
}

/// A triangle's box, and its number.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3A,
    high: Vec3A,
    triangle: u32,
}

impl Bounds {
    fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Of all of them; the number of the first.
    fn around(boxes: &[Self]) -> Self {
        let joined = |a: Self, b: &Self| Self { low: a.low.min(b.low), high: a.high.max(b.high), ..a };
        boxes[1..].iter().fold(boxes[0], joined)
    }
}

/// The same among some triangles, which are fast to compare where neighbours in the list lie near each other.
///
/// Boxes are joined by eights, and those by eights again. Each group of eight looks for others that overlap.
pub(super) fn intersecting_pairs_of(places: &[Vec3], triangles: &[[u32; 3]], among: &[u32]) -> Vec<[u32; 2]> {
    let bounds = |&triangle: &u32| {
        let [a, b, c] = triangles[triangle as usize].map(|i| Vec3A::from(places[i as usize]));
        Bounds { low: a.min(b).min(c), high: a.max(b).max(c), triangle }
    };
    let mut levels: Vec<Vec<Bounds>> = vec![among.par_iter().with_min_len(RUN * WIDE).map(bounds).collect()];
    while levels[levels.len() - 1].len() > WIDE {
        let groups = levels[levels.len() - 1].chunks(WIDE).map(Bounds::around).collect();
        levels.push(groups);
    }
    let search = Search { places, triangles, levels: &levels };
    let of_group = |group: usize| {
        let mut pairs = Vec::new();
        let top = levels.len() - 1;
        if top == 0 {
            search.compare(0, 0, &mut pairs);
        } else {
            (0..levels[top].len()).for_each(|k| search.descend(top, k, group, &mut pairs));
        }
        pairs
    };
    let groups = levels[0].len().div_ceil(WIDE);
    let found = (0..groups).into_par_iter().with_min_len(RUN).flat_map_iter(of_group);
    let mut pairs: Vec<[u32; 2]> = found.collect();
    pairs.sort_unstable();
    pairs
}

struct Search<'a> {
    places: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    levels: &'a [Vec<Bounds>],
}

impl Search<'_> {
    /// Compares group `own` of triangles with those under box `k` of a level that do not come before it.
    fn descend(&self, level: usize, k: usize, own: usize, pairs: &mut Vec<[u32; 2]>) {
        let last_below = (k + 1) * WIDE.pow(level as u32 - 1) - 1;
        if last_below < own || !self.levels[1][own].overlaps(&self.levels[level][k]) {
            return;
        }
        if level == 1 {
            return self.compare(own, k, pairs);
        }
        let end = ((k + 1) * WIDE).min(self.levels[level - 1].len());
        (k * WIDE..end).for_each(|child| self.descend(level - 1, child, own, pairs));
    }

    fn compare(&self, own: usize, other: usize, pairs: &mut Vec<[u32; 2]>) {
        let boxes = &self.levels[0];
        let range = |group: usize| group * WIDE..((group + 1) * WIDE).min(boxes.len());
        for i in range(own) {
            let (a, from) = (&boxes[i], if own == other { i + 1 } else { 0 });
            if self.levels.get(1).is_some_and(|groups| !a.overlaps(&groups[other])) {
                continue;
            }
            for b in range(other).filter(|&j| j >= from).map(|j| &boxes[j]) {
                if a.overlaps(b) && self.intersect(a.triangle, b.triangle) {
                    pairs.push([a.triangle.min(b.triangle), a.triangle.max(b.triangle)]);
                }
            }
        }
    }

    /// Whether an edge of one passes through the inside of the other. Triangles that share a corner never count.
    fn intersect(&self, s: u32, t: u32) -> bool {
        let (s, t) = (self.triangles[s as usize], self.triangles[t as usize]);
        if s.iter().any(|i| t.contains(i)) {
            return false;
        }
        let [s, t] = [s, t].map(|corners| corners.map(|i| self.places[i as usize].as_dvec3()));
        if on_one_side(&s, &t) || on_one_side(&t, &s) {
            return false;
        }
        (0..3).any(|k| passes(s[k], s[(k + 1) % 3], &t) || passes(t[k], t[(k + 1) % 3], &s))
    }
}

/// Whether all of one triangle lies strictly on one side of the other's plane, as most neighbours do.
fn on_one_side(&[a, b, c]: &[DVec3; 3], other: &[DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    let heights = other.map(|p| (p - a).dot(normal));
    heights.iter().all(|&h| h > 0.0) || heights.iter().all(|&h| h < 0.0)
}

/// Whether the segment from `a` to `b` crosses a triangle (Möller and Trumbore, 1997).
fn passes(a: DVec3, b: DVec3, &[p, q, r]: &[DVec3; 3]) -> bool {
    let (direction, e, f) = (b - a, q - p, r - p);
    let h = direction.cross(f);
    let determinant = e.dot(h);
    if determinant.abs() < 1e-14 * direction.length() * e.length() * f.length() {
        return false;
    }
    let from = a - p;
    let u = from.dot(h) / determinant;
    let across = from.cross(e);
    let v = direction.dot(across) / determinant;
    let along = f.dot(across) / determinant;
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && along > 1e-9 && along < 1.0 - 1e-9
}
