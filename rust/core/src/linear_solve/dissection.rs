//! Nested dissection by coordinates: cut the point cloud in half, take out the unknowns that couple the halves, repeat.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use glam::Vec3;

use super::bisection::{Plane, Point, halve, principal_axes};
use super::graph::Graph;
use super::patch::{self, Patch, first_where};
use super::vertex_cover::minimum_vertex_cover;

/// Sets above this size are cut on two threads.
const FORK: usize = 4096;
/// Sets above this size try every axis; below, the longest one is good enough.
const TRY_AXES: usize = 8192;
/// A separator that takes more than this share of a set larger than [`FORK`] tells that positions do not follow the graph.
const POOR: f64 = 0.3;

/// A node of the elimination tree: a separator or a leaf, all of it eliminated after its descendants.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    /// Number of unknowns.
    pub(super) columns: usize,
    /// Number of nodes under this one; they come right before it.
    pub(super) descendants: usize,
}

/// An elimination order with its tree, nodes in post-order.
pub(super) struct Dissection {
    /// Unknown at each place of the order, (n).
    pub(super) order: Vec<u32>,
    /// Place of each unknown, (n).
    pub(super) place: Vec<u32>,
    pub(super) nodes: Vec<Node>,
}

/// Orders the unknowns of `graph`. `None` when separators turn out large: the graph is no surface with these positions.
pub(super) fn dissect(graph: &Graph, positions: &[Vec3]) -> Option<Dissection> {
    let mut points = points(graph, positions);
    let cutter = Cutter {
        graph,
        positions,
        removed: (0..points.len()).map(|_| AtomicBool::new(false)).collect(),
        place: (0..points.len()).map(|_| AtomicU32::new(u32::MAX)).collect(),
    };
    let nodes = cutter.dissect(&mut points, 0)?;
    Some(Dissection {
        order: points.iter().map(|point| point.unknown).collect(),
        place: cutter.place.into_iter().map(AtomicU32::into_inner).collect(),
        nodes,
    })
}

fn points(graph: &Graph, positions: &[Vec3]) -> Vec<Point> {
    let point = |(i, &position): (usize, &Vec3)| {
        let reach = graph.neighbours(i).map(|j| position.distance_squared(positions[j])).fold(0.0, f32::max).sqrt();
        Point { position, reach, unknown: i as u32, key: 0.0 }
    };
    positions.iter().enumerate().map(point).collect()
}

struct Cutter<'a> {
    graph: &'a Graph<'a>,
    positions: &'a [Vec3],
    /// Unknowns already in a separator.
    removed: Vec<AtomicBool>,
    place: Vec<AtomicU32>,
}

impl Cutter<'_> {
    /// Orders `points` in place, the first of which takes place `first`, and returns the nodes.
    fn dissect(&self, points: &mut [Point], first: usize) -> Option<Vec<Node>> {
        let n = points.len();
        if n <= patch::MOST {
            let nodes = self.patch(points);
            self.number(points, first);
            return Some(nodes);
        }
        let (below, above) = self.cut(points);
        if n > FORK && (n - below - above) as f64 > POOR * n as f64 {
            return None;
        }
        let (halves, separator) = points.split_at_mut(below + above);
        let (left, right) = halves.split_at_mut(below);
        let (left, right) = if n > FORK {
            rayon::join(|| self.dissect(left, first), || self.dissect(right, first + below))
        } else {
            (self.dissect(left, first), self.dissect(right, first + below))
        };
        let mut nodes = left?;
        nodes.extend(right?);
        self.sort_separator(separator, first, first + below + above);
        self.number(separator, first + below + above);
        nodes.push(Node { columns: separator.len(), descendants: nodes.len() });
        Some(nodes)
    }

    /// Orders a small set and returns its nodes.
    fn patch(&self, points: &mut [Point]) -> Vec<Node> {
        self.number(points, 0);
        let local = |j: usize| self.place[j].load(Ordering::Relaxed) as usize;
        let neighbours = |i: u32| self.graph.neighbours(i as usize).filter(|&j| !self.is_removed(j)).map(local);
        let mut nodes = Vec::new();
        Patch::new(points, neighbours).dissect(points, &mut nodes);
        nodes
    }

    fn number(&self, points: &[Point], first: usize) {
        for (place, point) in points.iter().enumerate() {
            self.place[point.unknown as usize].store((first + place) as u32, Ordering::Relaxed);
        }
    }

    /// Sorts a separator by its first neighbour among the descendants (places `first..end`), so that the part of it
    /// that touches one descendant is a run.
    fn sort_separator(&self, separator: &mut [Point], first: usize, end: usize) {
        let descendants = first as u32..end as u32;
        separator.sort_by_cached_key(|point| {
            let places = self.graph.neighbours(point.unknown as usize).map(|j| self.place[j].load(Ordering::Relaxed));
            (places.filter(|place| descendants.contains(place)).min(), point.unknown)
        });
    }

    /// Moves the points into the order (below, above, separator) and returns the first two's sizes.
    fn cut(&self, points: &mut [Point]) -> (usize, usize) {
        let (axes, origin) = (principal_axes(points), points[0].position);
        let tried = if points.len() > TRY_AXES { axes.len() } else { 1 };
        let plane = halve(points, axes[0], origin);
        let mut best = self.separator(points, plane);
        let (mut chosen, mut last) = (0, 0);
        for axis in 1..tried {
            let plane = halve(points, axes[axis], origin);
            let separator = self.separator(points, plane);
            last = axis;
            if separator.len() < best.len() {
                (best, chosen) = (separator, axis);
            }
        }
        if chosen != last {
            halve(points, axes[chosen], origin);
        }
        for &unknown in &best {
            self.removed[unknown as usize].store(true, Ordering::Relaxed);
        }
        let middle = points.len() / 2;
        let kept = |point: &Point| !self.is_removed(point.unknown as usize);
        let below = first_where(&mut points[..middle], kept);
        let above = first_where(&mut points[middle..], kept);
        points[below..].rotate_left(middle - below);
        (below, above)
    }

    fn is_removed(&self, unknown: usize) -> bool {
        self.removed[unknown].load(Ordering::Relaxed)
    }

    /// Unknowns without which no two of `points` on different sides of `plane` are coupled; as few as there can be.
    fn separator(&self, points: &[Point], plane: Plane) -> Vec<u32> {
        let (below, above) = points.split_at(points.len() / 2);
        let slack = 1e-5 * points.iter().fold(0.0, |extent: f32, point| extent.max(point.key.abs()));
        let far = |point: &&Point| (point.key - plane.key).abs() > 1.0001 * point.reach + slack;
        let mut upper = Vec::new();
        for point in above.iter().filter(|point| !far(point)) {
            let crosses = |j| !self.is_removed(j) && plane.is_below(self.positions[j], j as u32);
            if self.graph.neighbours(point.unknown as usize).any(crosses) {
                self.place[point.unknown as usize].store(upper.len() as u32, Ordering::Relaxed);
                upper.push(point.unknown);
            }
        }
        let (mut lower, mut starts, mut edges) = (Vec::new(), vec![0], Vec::new());
        for point in below.iter().filter(|point| !far(point)) {
            let crosses = |&j: &usize| !self.is_removed(j) && !plane.is_below(self.positions[j], j as u32);
            let across = self.graph.neighbours(point.unknown as usize).filter(crosses);
            edges.extend(across.map(|j| self.place[j].load(Ordering::Relaxed)));
            if edges.len() > starts[lower.len()] as usize {
                lower.push(point.unknown);
                starts.push(edges.len() as u32);
            }
        }
        for &unknown in &upper {
            self.place[unknown as usize].store(u32::MAX, Ordering::Relaxed);
        }
        let (left, right) = minimum_vertex_cover(&starts, &edges, upper.len());
        left.iter().map(|&i| lower[i as usize]).chain(right.iter().map(|&i| upper[i as usize])).collect()
    }
}
