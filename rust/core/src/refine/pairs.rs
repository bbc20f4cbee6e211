//! Pairs of triangles that pass through each other.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Triangles that one task compares with those after them.
const RUN: usize = 256;

/// Every pair of triangles that intersect and share no corner, each once, ascending.
pub fn intersecting_pairs(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    intersecting_pairs_of(&|i| Vec3::from(positions[i as usize]), triangles, None)
}

/// A triangle's box, and its number.
#[derive(Clone, Copy)]
struct Bounds {
    low: Vec3,
    high: Vec3,
    triangle: u32,
}

/// The same among some triangles (all if none are named).
///
/// Boxes are sorted along the longest axis, and each is compared with those that start before it ends.
pub(super) fn intersecting_pairs_of(
    at: &(dyn Fn(u32) -> Vec3 + Sync),
    triangles: &[[u32; 3]],
    among: Option<&[u32]>,
) -> Vec<[u32; 2]> {
    let bounds = |triangle: u32| {
        let [a, b, c] = triangles[triangle as usize].map(at);
        Bounds { low: a.min(b).min(c), high: a.max(b).max(c), triangle }
    };
    let mut boxes: Vec<Bounds> = match among {
        Some(among) => among.iter().map(|&t| bounds(t)).collect(),
        None => (0..triangles.len() as u32).map(bounds).collect(),
    };
    let axis = longest_axis(&boxes);
    boxes.sort_unstable_by(|a, b| a.low[axis].total_cmp(&b.low[axis]).then(a.triangle.cmp(&b.triangle)));
    let of_one = |k: usize| {
        let one = boxes[k];
        let overlapping = boxes[k + 1..].iter().take_while(|other| other.low[axis] <= one.high[axis]);
        let near = overlapping.filter(|o| one.low.cmple(o.high).all() && o.low.cmple(one.high).all());
        let corners = triangles[one.triangle as usize];
        let meets = near.filter(|o| intersect(at, corners, triangles[o.triangle as usize]));
        meets.map(|o| [one.triangle.min(o.triangle), one.triangle.max(o.triangle)]).collect::<Vec<_>>()
    };
    let mut pairs: Vec<[u32; 2]> = (0..boxes.len()).into_par_iter().with_min_len(RUN).flat_map_iter(of_one).collect();
    pairs.sort_unstable();
    pairs
}

fn longest_axis(boxes: &[Bounds]) -> usize {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = boxes.iter().fold(empty, |whole, part| (whole.0.min(part.low), whole.1.max(part.high)));
    (0..3).max_by(|&a, &b| (high - low)[a].total_cmp(&(high - low)[b])).expect("three axes")
}

/// Whether an edge of one passes through the inside of the other. Triangles that share a corner never count.
fn intersect(at: &dyn Fn(u32) -> Vec3, s: [u32; 3], t: [u32; 3]) -> bool {
    if s.iter().any(|i| t.contains(i)) {
        return false;
    }
    let (s, t) = (s.map(|i| at(i).as_dvec3()), t.map(|i| at(i).as_dvec3()));
    (0..3).any(|k| passes(s[k], s[(k + 1) % 3], &t) || passes(t[k], t[(k + 1) % 3], &s))
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
