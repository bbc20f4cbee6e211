//! Nested dissection by coordinates: cut the point cloud in half, take out the unknowns that couple the halves, repeat.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use glam::Vec3;
use rayon::prelude::*;

use crate::ordering::bisection::{Plane, Point, halve, principal_axes};
use crate::ordering::graph::Graph;
use crate::ordering::patch::{self, Node, Patch, first_where};
use crate::ordering::vertex_cover::minimum_vertex_cover;

/// Sets above this size are cut on two threads.
const FORK: usize = 4096;
/// Sets above this size try both axes; below, the longer one is good enough.
const TRY_AXES: usize = 8192;
/// A separator that takes more than this share of a set larger than [`FORK`] tells that positions do not follow the graph.
const POOR: f64 = 0.3;

/// An elimination order with its tree, nodes in post-order.
pub(crate) struct Dissection {
    /// Unknown at each place of the order, (n).
    pub(crate) order: Vec<u32>,
    /// Place of each unknown, (n).
    pub(crate) place: Vec<u32>,
    pub(crate) nodes: Vec<Node>,
}

/// Largest coordinate used; squared distances stay finite.
const FAR: f32 = 1e18;
/// In the list of places: not ordered yet, and in a separator but without a place so far.
const FREE: u32 = u32::MAX;
const SEPARATOR: u32 = u32::MAX - 1;

/// Orders the unknowns of `graph`. `None` when separators turn out large: the graph is no surface with these positions.
/// `None` too once `stop` is set.
pub(crate) fn dissect(graph: &Graph, positions: &[Vec3], stop: &AtomicBool) -> Option<Dissection> {
    let finite = |x: f32| if x.is_nan() { 0.0 } else { x.clamp(-FAR, FAR) };
    let positions: Vec<Vec3> = positions.iter().map(|p| Vec3::new(finite(p.x), finite(p.y), finite(p.z))).collect();
    let mut points = points(graph, &positions);
    let place = (0..points.len()).map(|_| AtomicU32::new(FREE)).collect();
    let cutter = Cutter { graph, positions: &positions, stop, place };
    let nodes = cutter.dissect(&mut points, 0)?;
    Some(Dissection {
        order: points.iter().map(|point| point.unknown).collect(),
        place: cutter.place.into_iter().map(AtomicU32::into_inner).collect(),
        nodes,
    })
}

fn points(graph: &Graph, positions: &[Vec3]) -> Vec<Point> {
    let point = |(i, &position): (usize, &Vec3)| {
        // In f64: the square of a tiny edge is zero in f32, and what seems not to cross a plane is not looked at.
        let from = position.as_dvec3();
        let squared = graph.neighbours(i).map(|j| from.distance_squared(positions[j].as_dvec3()));
        let farthest = squared.fold(0.0, f64::max);
        Point { position, reach: farthest.sqrt() as f32, unknown: i as u32, key: 0.0 }
    };
    positions.par_iter().with_min_len(FORK).enumerate().map(point).collect()
}

struct Cutter<'a> {
    graph: &'a Graph<'a>,
    positions: &'a [Vec3],
    stop: &'a AtomicBool,
    /// Place of each unknown, [`FREE`] or [`SEPARATOR`]; of the set at hand, passing notes. Sets that are cut at the same
    /// time share no unknown, and no neighbour but in separators.
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
        if self.stop.load(Ordering::Relaxed) {
            return None;
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
        let neighbours =
            |i: u32| self.graph.neighbours(i as usize).map(|j| self.place(j)).filter(|&local| local != SEPARATOR);
        let mut nodes = Vec::new();
        Patch::new(points, neighbours).dissect(points, &mut nodes);
        nodes
    }

    fn place(&self, unknown: usize) -> u32 {
        self.place[unknown].load(Ordering::Relaxed)
    }

    fn set_place(&self, unknown: u32, place: u32) {
        self.place[unknown as usize].store(place, Ordering::Relaxed);
    }

    fn number(&self, points: &[Point], first: usize) {
        for (place, point) in points.iter().enumerate() {
            self.set_place(point.unknown, (first + place) as u32);
        }
    }

    /// Sorts a separator by its first neighbour among the descendants (places `first..end`), so that the part of it
    /// that touches one descendant is a run.
    fn sort_separator(&self, separator: &mut [Point], first: usize, end: usize) {
        let descendants = first as u32..end as u32;
        separator.sort_by_cached_key(|point| {
            let places = self.graph.neighbours(point.unknown as usize).map(|j| self.place(j));
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
        for (axis, &direction) in axes.iter().enumerate().take(tried).skip(1) {
            let plane = halve(points, direction, origin);
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
            self.set_place(unknown, SEPARATOR);
        }
        let middle = points.len() / 2;
        let kept = |point: &Point| self.place(point.unknown as usize) != SEPARATOR;
        let below = first_where(&mut points[..middle], kept);
        let above = first_where(&mut points[middle..], kept);
        points[below..].rotate_left(middle - below);
        (below, above)
    }

    /// Unknowns without which no two of `points` on different sides of `plane` are coupled; as few as there can be.
    fn separator(&self, points: &[Point], plane: Plane) -> Vec<u32> {
        let (below, above) = points.split_at(points.len() / 2);
        let slack = 1e-5 * points.iter().fold(0.0, |extent: f32, point| extent.max(point.key.abs()));
        let far = |point: &&Point| (point.key - plane.key).abs() > 1.0001 * point.reach + slack;
        let mut upper = Vec::new();
        for point in above.iter().filter(|point| !far(point)) {
            let crosses = |j| self.place(j) != SEPARATOR && plane.is_below(self.positions[j], j as u32);
            if self.graph.neighbours(point.unknown as usize).any(crosses) {
                self.set_place(point.unknown, upper.len() as u32);
                upper.push(point.unknown);
            }
        }
        let (mut lower, mut starts, mut edges) = (Vec::new(), vec![0], Vec::new());
        for point in below.iter().filter(|point| !far(point)) {
            let crosses = |&j: &usize| self.place(j) != SEPARATOR && !plane.is_below(self.positions[j], j as u32);
            let across = self.graph.neighbours(point.unknown as usize).filter(crosses);
            edges.extend(across.map(|j| self.place(j)));
            if edges.len() > starts[lower.len()] as usize {
                lower.push(point.unknown);
                starts.push(edges.len() as u32);
            }
        }
        for &unknown in &upper {
            self.set_place(unknown, FREE);
        }
        let (left, right) = minimum_vertex_cover(&starts, &edges, upper.len());
        left.iter().map(|&i| lower[i as usize]).chain(right.iter().map(|&i| upper[i as usize])).collect()
    }
}
