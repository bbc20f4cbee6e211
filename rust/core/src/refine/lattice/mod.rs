//! Tetrahedra around and inside of a surface, which need not fit it: every vertex is embedded in one of them.
//!
//! Inside is where the generalised winding number exceeds a half, so that open, overlapping and non-manifold meshes work.

mod clones;
mod octahedra;
mod raster;
mod tetrahedron;

use glam::DVec3;
use rayon::prelude::*;

use self::clones::{Element, joined_corners, pieces};
pub(super) use self::octahedra::Octahedra;
use self::raster::{Crossing, crossings};
use self::tetrahedron::{Point, Tetrahedron, place};
use super::morton::morton;
use super::surface::Surface;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// Cubes that the bounding box may hold: more would take gigabytes.
const MOST_CUBES: f64 = 2e7;

/// A surface vertex in the lattice: corners of a tetrahedron and their shares.
#[derive(Debug, Clone, Copy)]
pub(super) struct Embedding {
    pub(super) nodes: [u32; 4],
    pub(super) shares: [f32; 4],
}

/// The lattice at rest.
#[derive(Debug)]
pub(super) struct Lattice {
    /// Places of the nodes, mesh units.
    pub(super) nodes: Vec<DVec3>,
    /// Corners, of positive volume.
    pub(super) tetrahedra: Vec<[u32; 4]>,
    /// Edges, the smaller node first.
    pub(super) edges: Vec<[u32; 2]>,
    /// Of each surface vertex; none for a loose one.
    pub(super) embedding: Vec<Option<Embedding>>,
    /// Tetrahedra that are copies of another.
    pub(super) cloned: usize,
}

impl Lattice {
    /// Covers `surface` with cells of edge `cell` (mesh units); `inside` takes a place in mesh units.
    ///
    /// # Errors
    /// [`Error::NothingInside`], [`Error::InvalidParameter`] for a cell that would need too many, [`Error::Cancelled`].
    pub(super) fn new(
        surface: &Surface,
        cell: f64,
        inside: &(dyn Fn(DVec3) -> bool + Sync),
        progress: &Progress,
    ) -> Result<Self> {
        let (low, high) = bounds(&surface.rest);
        check_size(cell, high - low)?;
        let cells = |p: &DVec3| (*p - low) / cell + 1.5;
        let places: Vec<DVec3> = surface.rest.iter().map(cells).collect();
        let inside = |at: DVec3| inside((at - 1.5) * cell + low);
        let crossed = crossings(&places, &surface.triangles);
        progress.check()?;
        let elements = elements(&crossed, &surface.triangles, (high - low) / cell, &inside, progress)?;
        let mut sets = joined_corners(&elements, &inside);
        progress.check()?;
        let (points, tetrahedra) = number(&elements, &mut sets);
        let embedding = embed(&elements, &tetrahedra, &places, surface);
        let nodes = points.into_iter().map(|p| (place(p) - 1.5) * cell + low).collect();
        let distinct = elements.windows(2).filter(|pair| pair[0].tetrahedron == pair[1].tetrahedron).count();
        Ok(Self { nodes, edges: edges(&tetrahedra), tetrahedra, embedding, cloned: distinct })
    }
}

fn bounds(places: &[DVec3]) -> (DVec3, DVec3) {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    places.iter().fold(empty, |(low, high), &p| (low.min(p), high.max(p)))
}

fn check_size(cell: f64, size: DVec3) -> Result<()> {
    let cubes = (size / cell + 3.0).ceil();
    if cubes.x * cubes.y * cubes.z <= MOST_CUBES {
        return Ok(());
    }
    Err(Error::InvalidParameter {
        name: "cell",
        value: cell,
        must: "must be larger: the bounding box would hold more than 20 million of them",
    })
}

/// Copies of the tetrahedra that skin crosses, and the tetrahedra wholly inside; sorted by tetrahedron.
fn elements(
    crossed: &[Crossing],
    triangles: &[[u32; 3]],
    size: DVec3,
    inside: &(dyn Fn(DVec3) -> bool + Sync),
    progress: &Progress,
) -> Result<Vec<Element>> {
    let of_tetrahedron = crossed.chunk_by(|a, b| a.tetrahedron == b.tetrahedron).collect::<Vec<_>>();
    let mut elements: Vec<Element> =
        of_tetrahedron.par_iter().flat_map_iter(|crossings| pieces(crossings, triangles, &inside)).collect();
    let crossed = |t: &Tetrahedron| of_tetrahedron.binary_search_by_key(t, |group| group[0].tetrahedron).is_ok();
    let [x, y, z] = size.ceil().as_ivec3().to_array().map(|n| n + 3);
    let cubes = |i: i32| (0..y).flat_map(move |j| (0..z).map(move |k| [i, j, k]));
    let middles = |i: i32| {
        progress.check()?;
        Ok(cubes(i).map(|cube| inside(DVec3::from(cube.map(f64::from)) + 0.5)).collect::<Vec<_>>())
    };
    let middles: Vec<Vec<bool>> = (0..x + 1).into_par_iter().map(middles).collect::<Result<_>>()?;
    let middle = |[i, j, k]: [i32; 3]| j < y && k < z && middles[i as usize][(j * z + k) as usize];
    // A tetrahedron that skin does not cross lies on the side of its two cubes' middles, where those agree.
    let within = |t: &Tetrahedron| {
        let mut other = t.cube;
        other[t.axis as usize] += 1;
        let (a, b) = (middle(t.cube), middle(other));
        if a == b { a } else { inside(t.centre()) }
    };
    let slab = |i: i32| {
        let bare = cubes(i).flat_map(Tetrahedron::of_cube).filter(|t| within(t) && !crossed(t));
        bare.map(Element::inside).collect::<Vec<_>>()
    };
    let slabs: Vec<Vec<Element>> = (0..x).into_par_iter().map(slab).collect();
    if slabs.iter().all(Vec::is_empty) && !anything_inside(&elements, inside) {
        return Err(Error::NothingInside);
    }
    elements.extend(slabs.into_iter().flatten());
    elements.sort_by(|a, b| (a.tetrahedron, &a.triangles).cmp(&(b.tetrahedron, &b.triangles)));
    Ok(elements)
}

/// Whether a corner or the centre of any crossed tetrahedron is inside: thin limbs may have no more.
fn anything_inside(elements: &[Element], inside: &(dyn Fn(DVec3) -> bool + Sync)) -> bool {
    elements
        .par_iter()
        .any(|e| inside(e.tetrahedron.centre()) || e.tetrahedron.corners().iter().any(|&corner| inside(place(corner))))
}

/// Numbers the nodes along a Morton curve, so that neighbours lie together in memory.
fn number(elements: &[Element], sets: &mut crate::adjacency::DisjointSets) -> (Vec<Point>, Vec<[u32; 4]>) {
    let corner_sets: Vec<u32> = (0..4 * elements.len() as u32).map(|k| sets.find(k)).collect();
    let point = |k: u32| elements[k as usize / 4].tetrahedron.corners()[k as usize % 4];
    let mut roots: Vec<u32> =
        corner_sets.iter().enumerate().filter(|(k, r)| **r == *k as u32).map(|(_, &r)| r).collect();
    roots.sort_by_key(|&root| (morton(point(root)), root));
    let mut node = vec![0u32; corner_sets.len()];
    for (n, &root) in roots.iter().enumerate() {
        node[root as usize] = n as u32;
    }
    let mut tetrahedra: Vec<[u32; 4]> =
        corner_sets.as_chunks::<4>().0.iter().map(|corners| corners.map(|root| node[root as usize])).collect();
    let points: Vec<Point> = roots.iter().map(|&root| point(root)).collect();
    for t in &mut tetrahedra {
        let [a, b, c, d] = t.map(|n| place(points[n as usize]));
        if (b - a).dot((c - a).cross(d - a)) < 0.0 {
            t.swap(2, 3);
        }
    }
    (points, tetrahedra)
}

fn edges(tetrahedra: &[[u32; 4]]) -> Vec<[u32; 2]> {
    const PAIRS: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];
    let sides = |t: &[u32; 4]| PAIRS.map(|[i, j]| [t[i].min(t[j]), t[i].max(t[j])]);
    let mut edges: Vec<_> = tetrahedra.iter().flat_map(sides).collect();
    edges.par_sort_unstable();
    edges.dedup();
    edges
}

fn embed(elements: &[Element], tetrahedra: &[[u32; 4]], places: &[DVec3], surface: &Surface) -> Vec<Option<Embedding>> {
    let mut a_triangle = vec![u32::MAX; surface.len()];
    for (t, corners) in surface.triangles.iter().enumerate().rev() {
        corners.iter().for_each(|&i| a_triangle[i as usize] = t as u32);
    }
    let of_vertex = |(i, &at): (usize, &DVec3)| {
        let holds = Tetrahedron::at(at);
        let first = elements.partition_point(|e| e.tetrahedron < holds);
        let copies = elements[first..].iter().take_while(|e| e.tetrahedron == holds);
        let mut copies = copies.enumerate().filter(|(_, e)| e.triangles.binary_search(&a_triangle[i]).is_ok());
        let (k, _) = copies.next()?;
        // The corners of a copy are in the tetrahedron's order but for the swap that makes its volume positive.
        let shares = holds.barycentric(at);
        let nodes = tetrahedra[first + k];
        let swapped = swapped(holds);
        let shares = if swapped { [shares[0], shares[1], shares[3], shares[2]] } else { shares };
        Some(Embedding { nodes, shares: shares.map(|x| x as f32) })
    };
    places.iter().enumerate().map(of_vertex).collect()
}

fn swapped(tetrahedron: Tetrahedron) -> bool {
    let [a, b, c, d] = tetrahedron.corners().map(place);
    (b - a).dot((c - a).cross(d - a)) < 0.0
}
