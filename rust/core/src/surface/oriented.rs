//! Closest points where a difference of normals counts as a distance.
//!
//! A surface point and its normal times a length are one point in six dimensions, and a triangle whose normals are
//! interpolated linearly is a flat triangle there. So the search is an ordinary closest-point query, exact, in a binary
//! tree of six-dimensional boxes.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Triangles of a leaf.
const LEAF: usize = 4;
/// Queries of a task; within it each search starts from the last one's answer.
const BATCH: usize = 256;

type Six = [f64; 6];

/// A point on an oriented surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OrientedPoint {
    /// Index of the triangle.
    pub triangle: u32,
    /// Barycentric coordinates, non-negative, summing to 1.
    pub barycentric: [f64; 3],
    /// Distance in six dimensions: `sqrt(|x - p|^2 + length^2 |n - n(p)|^2)`, world units.
    pub lifted_distance: f64,
}

/// A mesh prepared for closest points by position and normal. The answer is the triangle with the smallest distance, of
/// equal ones the lowest index, whatever the number of threads.
#[derive(Debug)]
pub struct OrientedSurface {
    normal_length: f64,
    /// Triangles in the tree's order: index and corners.
    leaves: Vec<(u32, [Six; 3])>,
    nodes: Vec<Node>,
}

/// A box and what is inside of it: two children, the first of which follows, or a run of triangles.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: [f32; 6],
    high: [f32; 6],
    /// Index of the second child, or the first triangle.
    next: u32,
    /// Number of triangles, 0 for an inner node.
    count: u32,
}

impl OrientedSurface {
    /// Prepares `triangles` (T) over `positions` and unit `normals` (V). Normals that differ by a unit count as far apart as
    /// points that are `normal_length` apart. None if there are no triangles.
    pub fn new(positions: &[DVec3], normals: &[Vec3], triangles: &[[u32; 3]], normal_length: f64) -> Option<Self> {
        let corner = |i: u32| lift(positions[i as usize], normals[i as usize].as_dvec3(), normal_length);
        let mut leaves: Vec<(u32, [Six; 3])> =
            triangles.iter().zip(0u32..).map(|(corners, t)| (t, corners.map(corner))).collect();
        let mut nodes = Vec::with_capacity(2 * leaves.len().div_ceil(LEAF).next_power_of_two());
        if leaves.is_empty() {
            return None;
        }
        build(&mut leaves, 0, &mut nodes);
        Some(Self { normal_length, leaves, nodes })
    }

    /// The closest point for each pair of a position and a unit normal (Q), on rayon's current pool.
    pub fn closest_points(&self, positions: &[DVec3], normals: &[Vec3]) -> Vec<OrientedPoint> {
        let mut answers = vec![OrientedPoint::default(); positions.len()];
        let batches = answers.par_chunks_mut(BATCH).zip(positions.par_chunks(BATCH)).zip(normals.par_chunks(BATCH));
        batches.for_each(|((answers, positions), normals)| {
            let (mut stack, mut start) = (Vec::new(), 0);
            for ((answer, &position), normal) in answers.iter_mut().zip(positions).zip(normals) {
                let query = lift(position, normal.as_dvec3(), self.normal_length);
                (*answer, start) = self.closest(&query, start, &mut stack);
            }
        });
        answers
    }

    /// The answer and its place; `start` is a place that is likely near and does not change the answer.
    fn closest(&self, query: &Six, start: usize, stack: &mut Vec<(f64, u32)>) -> (OrientedPoint, usize) {
        let mut best = Best { squared: f64::INFINITY, triangle: u32::MAX, barycentric: [0.0; 3], place: start };
        best.consider(query, &self.leaves[start], start);
        stack.push((self.nodes[0].squared_distance(query), 0));
        while let Some((at_least, at)) = stack.pop() {
            if at_least > best.squared {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count > 0 {
                for place in node.next as usize..(node.next + node.count) as usize {
                    best.consider(query, &self.leaves[place], place);
                }
                continue;
            }
            let children = [at + 1, node.next].map(|c| (self.nodes[c as usize].squared_distance(query), c));
            let [near, far] = if children[0].0 <= children[1].0 { children } else { [children[1], children[0]] };
            stack.extend([far, near]);
        }
        let Best { squared, triangle, barycentric, place } = best;
        (OrientedPoint { triangle, barycentric, lifted_distance: squared.sqrt() }, place)
    }
}

fn lift(position: DVec3, normal: DVec3, length: f64) -> Six {
    let n = normal * length;
    [position.x, position.y, position.z, n.x, n.y, n.z]
}

/// Appends the tree over `leaves`, of which the first is number `first`.
fn build(leaves: &mut [(u32, [Six; 3])], first: usize, nodes: &mut Vec<Node>) {
    let (mut low, mut high) = ([f64::INFINITY; 6], [f64::NEG_INFINITY; 6]);
    for corner in leaves.iter().flat_map(|leaf| &leaf.1) {
        for axis in 0..6 {
            low[axis] = low[axis].min(corner[axis]);
            high[axis] = high[axis].max(corner[axis]);
        }
    }
    let at = nodes.len();
    let count = if leaves.len() <= LEAF { leaves.len() as u32 } else { 0 };
    nodes.push(Node { low: low.map(f32_below), high: high.map(f32_above), next: first as u32, count });
    if count == 0 {
        let extent = |axis: usize| high[axis] - low[axis];
        let axis = (0..6).max_by(|&a, &b| extent(a).total_cmp(&extent(b)).then(b.cmp(&a))).expect("six axes");
        let key = |leaf: &(u32, [Six; 3])| leaf.1.iter().map(|corner| corner[axis]).sum::<f64>();
        let middle = leaves.len() / 2;
        leaves.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)).then(a.0.cmp(&b.0)));
        let (left, right) = leaves.split_at_mut(middle);
        build(left, first, nodes);
        nodes[at].next = nodes.len() as u32;
        build(right, first + middle, nodes);
    }
}

fn f32_below(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

fn f32_above(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}

impl Node {
    fn squared_distance(&self, query: &Six) -> f64 {
        let mut sum = 0.0;
        for (axis, &x) in query.iter().enumerate() {
            let gap = (f64::from(self.low[axis]) - x).max(x - f64::from(self.high[axis])).max(0.0);
            sum += gap * gap;
        }
        sum
    }
}

struct Best {
    squared: f64,
    triangle: u32,
    barycentric: [f64; 3],
    place: usize,
}

impl Best {
    fn consider(&mut self, query: &Six, (triangle, corners): &(u32, [Six; 3]), place: usize) {
        let (squared, barycentric) = closest_in_triangle(query, corners);
        if squared < self.squared || (squared == self.squared && *triangle < self.triangle) {
            *self = Self { squared, triangle: *triangle, barycentric, place };
        }
    }
}

fn dot(a: &Six, b: &Six) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn minus(a: &Six, b: &Six) -> Six {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Squared distance and barycentric coordinates of the closest point of a triangle: inside, or on the nearest edge.
fn closest_in_triangle(query: &Six, [a, b, c]: &[Six; 3]) -> (f64, [f64; 3]) {
    let (ab, ac, aq) = (minus(b, a), minus(c, a), minus(query, a));
    let (bb, bc, cc) = (dot(&ab, &ab), dot(&ab, &ac), dot(&ac, &ac));
    let (qb, qc) = (dot(&aq, &ab), dot(&aq, &ac));
    let det = bb * cc - bc * bc;
    if det > 1e-14 * bb * cc {
        let (v, w) = ((cc * qb - bc * qc) / det, (bb * qc - bc * qb) / det);
        if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
            return measured(query, [a, b, c], [1.0 - v - w, v, w]);
        }
    }
    let on_edge = |from: &Six, to: &Six| {
        let (edge, offset) = (minus(to, from), minus(query, from));
        let length = dot(&edge, &edge);
        if length > 0.0 { (dot(&offset, &edge) / length).clamp(0.0, 1.0) } else { 0.0 }
    };
    let (s, t, u) = (on_edge(a, b), on_edge(b, c), on_edge(c, a));
    let edges = [[1.0 - s, s, 0.0], [0.0, 1.0 - t, t], [u, 0.0, 1.0 - u]];
    let measured = edges.map(|barycentric| measured(query, [a, b, c], barycentric));
    measured.into_iter().min_by(|x, y| x.0.total_cmp(&y.0)).expect("three edges")
}

fn measured(query: &Six, corners: [&Six; 3], barycentric: [f64; 3]) -> (f64, [f64; 3]) {
    let mut squared = 0.0;
    for axis in 0..6 {
        let x: f64 = corners.iter().zip(barycentric).map(|(corner, share)| corner[axis] * share).sum();
        squared += (query[axis] - x) * (query[axis] - x);
    }
    (squared, barycentric)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(k: usize) -> f64 {
        (k as f64 * 12.9898).sin()
    }

    fn point(k: usize) -> DVec3 {
        DVec3::new(wave(3 * k), wave(3 * k + 1), wave(3 * k + 2))
    }

    #[test]
    fn agrees_with_all_triangles() {
        let positions: Vec<DVec3> = (0..900).map(point).collect();
        let normals: Vec<Vec3> = (0..900).map(|k| point(k + 7000).normalize().as_vec3()).collect();
        let triangles: Vec<[u32; 3]> = (0..600u32).map(|t| [t, (t * 7 + 1) % 900, (t * 13 + 2) % 900]).collect();
        let surface = OrientedSurface::new(&positions, &normals, &triangles, 0.3).unwrap();
        let queries: Vec<DVec3> = (0..400).map(|k| 1.5 * point(k + 90_000)).collect();
        let directions: Vec<Vec3> = (0..400).map(|k| point(k + 50_000).normalize().as_vec3()).collect();
        for (k, found) in surface.closest_points(&queries, &directions).iter().enumerate() {
            let query = lift(queries[k], directions[k].as_dvec3(), 0.3);
            let corner = |i: u32| lift(positions[i as usize], normals[i as usize].as_dvec3(), 0.3);
            let all = triangles.iter().map(|t| closest_in_triangle(&query, &t.map(corner)).0);
            let (nearest, squared) = all.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            assert_eq!((found.triangle as usize, found.lifted_distance), (nearest, squared.sqrt()));
        }
    }

    #[test]
    fn the_closest_point_of_a_triangle_beats_a_fine_sampling() {
        for k in 0..50 {
            let corners = [0, 1, 2].map(|c| lift(point(9 * k + c), point(9 * k + c + 3), 0.5));
            let query = lift(2.0 * point(9 * k + 6), point(9 * k + 7), 0.5);
            let (squared, barycentric) = closest_in_triangle(&query, &corners);
            assert!(barycentric.iter().all(|&x| x >= 0.0) && (barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let grid =
                (0..=60).flat_map(|i| (0..=60 - i).map(move |j| [i, j, 60 - i - j].map(|x| f64::from(x) / 60.0)));
            let [a, b, c] = &corners;
            let sampled = grid.map(|at| measured(&query, [a, b, c], at).0).fold(f64::INFINITY, f64::min);
            assert!(squared <= sampled + 1e-12 && sampled < squared + 0.2, "{squared} {sampled}");
        }
    }
}
