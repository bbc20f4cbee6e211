//! Pairs of triangles that pass through each other.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Every pair of triangles that intersect and share no corner, each once, ascending.
///
/// A sweep along the longest axis of the bounding box, cut into slabs that are searched in parallel.
pub fn intersecting_pairs(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let boxes: Vec<(Vec3, Vec3)> =
        triangles.iter().map(|t| bounds(t.map(|i| Vec3::from(positions[i as usize])))).collect();
    let axis = longest_axis(&boxes);
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    order
        .par_sort_unstable_by(|&a, &b| boxes[a as usize].0[axis].total_cmp(&boxes[b as usize].0[axis]).then(a.cmp(&b)));
    let of_one = |k: usize| {
        let i = order[k];
        let (low, high) = boxes[i as usize];
        let overlapping = order[k + 1..].iter().take_while(|&&j| boxes[j as usize].0[axis] <= high[axis]);
        let near = overlapping.filter(|&&j| {
            let (other_low, other_high) = boxes[j as usize];
            low.cmple(other_high).all() && other_low.cmple(high).all()
        });
        let meets = near.filter(|&&j| intersect(positions, triangles[i as usize], triangles[j as usize]));
        meets.map(|&j| [i.min(j), i.max(j)]).collect::<Vec<_>>()
    };
    let mut pairs: Vec<[u32; 2]> = (0..order.len()).into_par_iter().with_min_len(256).flat_map_iter(of_one).collect();
    pairs.par_sort_unstable();
    pairs
}

fn bounds([a, b, c]: [Vec3; 3]) -> (Vec3, Vec3) {
    (a.min(b).min(c), a.max(b).max(c))
}

fn longest_axis(boxes: &[(Vec3, Vec3)]) -> usize {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = boxes.iter().fold(empty, |whole, part| (whole.0.min(part.0), whole.1.max(part.1)));
    (0..3).max_by(|&a, &b| (high - low)[a].total_cmp(&(high - low)[b])).expect("three axes")
}

/// Whether an edge of one passes through the inside of the other. Triangles that share a corner never count.
fn intersect(positions: &[[f32; 3]], s: [u32; 3], t: [u32; 3]) -> bool {
    if s.iter().any(|i| t.contains(i)) {
        return false;
    }
    let corners = |t: [u32; 3]| t.map(|i| Vec3::from(positions[i as usize]).as_dvec3());
    let (s, t) = (corners(s), corners(t));
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
