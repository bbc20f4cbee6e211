//! One tetrahedron per piece of flesh: where skin of two limbs lies in one, each gets a copy of its own.

use std::collections::HashMap;

use glam::DVec3;

use super::raster::Crossing;
use super::tetrahedron::{Point, Tetrahedron, place};
use crate::adjacency::DisjointSets;

/// A copy of a tetrahedron with the triangles it carries; none inside of the mesh.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) tetrahedron: Tetrahedron,
    /// Ascending.
    pub(super) triangles: Vec<u32>,
    samples: Vec<DVec3>,
}

impl Element {
    pub(super) fn inside(tetrahedron: Tetrahedron) -> Self {
        Self { tetrahedron, triangles: Vec::new(), samples: Vec::new() }
    }

    fn shares_a_triangle(&self, other: &Self) -> bool {
        self.triangles.iter().any(|t| other.triangles.binary_search(t).is_ok())
    }

    /// Squared distance of the nearest sample, or of the centre where there is none.
    fn distance(&self, to: DVec3) -> f64 {
        let squares = self.samples.iter().map(|sample| sample.distance_squared(to));
        squares.min_by(f64::total_cmp).unwrap_or_else(|| self.tetrahedron.centre().distance_squared(to))
    }
}

/// The copies of one tetrahedron: a piece per connected patch of skin, patches with flesh between them in one.
pub(super) fn pieces(crossings: &[Crossing], triangles: &[[u32; 3]], inside: &dyn Fn(DVec3) -> bool) -> Vec<Element> {
    let mut sets = DisjointSets::new(crossings.len());
    let mut first_at: HashMap<u32, u32> = HashMap::new();
    for (k, crossing) in crossings.iter().enumerate() {
        for &i in &triangles[crossing.triangle as usize] {
            let first = *first_at.entry(i).or_insert(k as u32);
            sets.union(first, k as u32);
        }
    }
    join_across_flesh(&mut sets, crossings, inside);
    let (piece, count) = sets.number(|_| true);
    let mut elements: Vec<_> = (0..count).map(|_| Element::inside(crossings[0].tetrahedron)).collect();
    for (crossing, &piece) in crossings.iter().zip(&piece) {
        elements[piece as usize].triangles.push(crossing.triangle);
        elements[piece as usize].samples.push(crossing.sample);
    }
    elements
}

fn join_across_flesh(sets: &mut DisjointSets, crossings: &[Crossing], inside: &dyn Fn(DVec3) -> bool) {
    let mut roots: Vec<u32> = (0..crossings.len() as u32).map(|k| sets.find(k)).collect();
    let of_root = roots.clone();
    roots.sort_unstable();
    roots.dedup();
    let samples = |root: u32| of_root.iter().zip(crossings).filter(move |(r, _)| **r == root).map(|(_, c)| c.sample);
    for (n, &a) in roots.iter().enumerate() {
        for &b in &roots[n + 1..] {
            let pairs = samples(a).flat_map(|x| samples(b).map(move |y| (x, y)));
            let nearest = pairs.min_by(|p, q| p.0.distance_squared(p.1).total_cmp(&q.0.distance_squared(q.1)));
            let (x, y) = nearest.expect("every piece has a sample");
            if inside((x + y) / 2.0) {
                sets.union(a, b);
            }
        }
    }
}

/// Which corners are one node: those of copies that hang together through a face.
pub(super) fn joined_corners(elements: &[Element], inside: &dyn Fn(DVec3) -> bool) -> DisjointSets {
    let mut sets = DisjointSets::new(4 * elements.len());
    let mut faces: HashMap<[Point; 3], Vec<u32>> = HashMap::with_capacity(2 * elements.len());
    let mut order = Vec::with_capacity(2 * elements.len());
    for (e, element) in elements.iter().enumerate() {
        for face in faces_of(element.tetrahedron) {
            let sharers = faces.entry(face).or_default();
            if sharers.is_empty() {
                order.push(face);
            }
            sharers.push(e as u32);
        }
    }
    for face in order {
        for (a, b) in links(elements, &faces[&face], face, inside) {
            join(&mut sets, elements, [a, b], face);
        }
    }
    sets
}

/// The pairs of copies on both sides of a face that hang together.
fn links(elements: &[Element], sharers: &[u32], face: [Point; 3], inside: &dyn Fn(DVec3) -> bool) -> Vec<(u32, u32)> {
    let first = elements[sharers[0] as usize].tetrahedron;
    let (left, right): (Vec<u32>, Vec<u32>) = sharers.iter().partition(|&&e| elements[e as usize].tetrahedron == first);
    let pairs = || left.iter().flat_map(|&a| right.iter().map(move |&b| (a, b)));
    let shared: Vec<_> =
        pairs().filter(|&(a, b)| elements[a as usize].shares_a_triangle(&elements[b as usize])).collect();
    if !shared.is_empty() {
        return shared;
    }
    let centre = face.into_iter().map(place).sum::<DVec3>() / 3.0;
    // A bare tetrahedron lies inside with all of its faces.
    let bare = sharers.iter().any(|&e| elements[e as usize].triangles.is_empty());
    if !bare && !inside(centre) {
        return Vec::new();
    }
    let distance = |&(a, b): &(u32, u32)| elements[a as usize].distance(centre) + elements[b as usize].distance(centre);
    pairs().min_by(|p, q| distance(p).total_cmp(&distance(q))).into_iter().collect()
}

fn join(sets: &mut DisjointSets, elements: &[Element], pair: [u32; 2], face: [Point; 3]) {
    for point in face {
        let [a, b] = pair.map(|e| {
            let corners = elements[e as usize].tetrahedron.corners();
            4 * e + corners.iter().position(|&corner| corner == point).expect("a corner of the face") as u32
        });
        sets.union(a, b);
    }
}

fn faces_of(tetrahedron: Tetrahedron) -> [[Point; 3]; 4] {
    let [a, b, c, d] = tetrahedron.corners();
    [[b, c, d], [a, c, d], [a, b, d], [a, b, c]].map(|mut face| {
        face.sort_unstable();
        face
    })
}
