//! Pairs of triangles that pass through each other.

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::morton::morton;

/// Boxes in a group, and groups in a larger one.
const WIDE: usize = 8;
/// Groups that one task compares with all others.
const RUN: usize = 16;
/// Steps of the Morton curve's grid along the longest side.
const STEPS: f32 = (1 << 20) as f32;
/// What rounding changes at most in the distance of a point along a direction, as a share of its coordinates.
const ROUNDING: f32 = 1e-6;

/// Every pair of triangles that intersect and share no corner, each once, ascending.
pub fn intersecting_pairs(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let places: Vec<Vec3> = positions.iter().map(|&p| p.into()).collect();
    let centre = |t: &[u32; 3]| t.map(|i| places[i as usize]).iter().sum::<Vec3>() / 3.0;
    let low = places.iter().fold(Vec3::INFINITY, |low, &p| low.min(p));
    let high = places.iter().fold(Vec3::NEG_INFINITY, |high, &p| high.max(p));
    let scale = STEPS / (high - low).max_element().max(f32::MIN_POSITIVE);
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    order.sort_by_cached_key(|&t| (morton(((centre(&triangles[t as usize]) - low) * scale).as_ivec3().to_array()), t));
    intersecting_pairs_of(&places, triangles, Suspects::all_of(&order), &Slabs::new([]))
}

/// Directions across which triangles are bounded: the axes, and planes that skin is pressed against. It fills boxes that lie
/// in each other where a plane slants, but only thin slabs along the plane's normal.
#[derive(Debug, Clone)]
pub(super) struct Slabs(Vec<Vec3>);

impl Slabs {
    /// How many normals are worth their tests.
    const MOST: usize = 5;

    /// Along the first few of `normals`, which tell most apart and are looked at first, and the axes.
    pub(super) fn new(normals: impl IntoIterator<Item = Vec3>) -> Self {
        Self(normals.into_iter().take(Self::MOST).chain([Vec3::X, Vec3::Y, Vec3::Z]).collect())
    }
}

/// Triangles' extents along each direction of [`Slabs`], by eights, and those of eights by eights again. Pieces are a
/// direction too, the first.
struct Tree {
    /// How many directions there are.
    directions: usize,
    /// Of each triangle.
    extents: Vec<Extents>,
    /// Of each leaf of eight.
    leaves: Vec<Extents>,
    levels: Vec<Vec<Eight>>,
}

/// Extents of eight along one direction, from and to. What is missing in the last ones overlaps nothing.
#[derive(Clone, Copy)]
struct Eight([[Vec4; 2]; 2]);

/// An extent along each direction.
type Extents = [[f32; 2]; 4 + Slabs::MOST];
const NOWHERE: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

impl Eight {
    fn new(extents: &[Extents], direction: usize) -> Self {
        let of = |k: usize| extents.get(k).map_or(NOWHERE, |extents| extents[direction]);
        let four = |first: usize, end: usize| Vec4::from_array([0, 1, 2, 3].map(|k| of(first + k)[end]));
        Self([0, 1].map(|end| [four(0, end), four(4, end)]))
    }

    /// A bit for each that overlaps an extent.
    fn overlapping(&self, [from, to]: [f32; 2]) -> u32 {
        let (from, to) = (Vec4::splat(from), Vec4::splat(to));
        let half = |k: usize| (self.0[0][k].cmple(to) & self.0[1][k].cmpge(from)).bitmask();
        half(0) | half(1) << 4
    }
}

impl Tree {
    fn new(slabs: &Slabs, places: &[Vec3], triangles: &[[u32; 3]], among: &[u32], pieces: Option<&Pieces<'_>>) -> Self {
        let directions = slabs.0.len() + usize::from(pieces.is_some());
        let of_one = |&t: &u32| {
            let corners = triangles[t as usize].map(|i| places[i as usize]);
            extents(slabs, corners, pieces.map(|piece| piece(t)))
        };
        let extents: Vec<Extents> = among.par_iter().with_min_len(RUN * WIDE).map(of_one).collect();
        let leaves: Vec<Extents> = extents.chunks(WIDE).map(joined).collect();
        let mut levels = vec![by_eights(&extents, directions)];
        let mut groups = leaves.clone();
        while groups.len() > 1 {
            levels.push(by_eights(&groups, directions));
            groups = groups.chunks(WIDE).map(joined).collect();
        }
        Self { directions, extents, leaves, levels }
    }

    /// A bit for each child of a node that overlaps `extents`.
    fn overlapping(&self, level: usize, node: usize, extents: &Extents) -> u32 {
        let of_node = &self.levels[level][node * self.directions..(node + 1) * self.directions];
        let mut bits = 0xff;
        for (direction, &extent) in of_node.iter().zip(extents) {
            bits &= direction.overlapping(extent);
            if bits == 0 {
                break;
            }
        }
        bits
    }
}

/// Every eight of them along each direction.
fn by_eights(extents: &[Extents], directions: usize) -> Vec<Eight> {
    let groups = extents.par_chunks(WIDE).with_min_len(RUN);
    groups.flat_map_iter(|group| (0..directions).map(|direction| Eight::new(group, direction))).collect()
}

fn joined(group: &[Extents]) -> Extents {
    let mut all = group[0];
    for one in &group[1..] {
        for (all, one) in all.iter_mut().zip(one) {
            *all = [all[0].min(one[0]), all[1].max(one[1])];
        }
    }
    all
}

fn extents(slabs: &Slabs, corners: [Vec3; 3], piece: Option<u32>) -> Extents {
    // What rounding may change: no pair that intersects may be lost.
    let largest = corners.map(Vec3::abs).iter().fold(Vec3::ZERO, |most, &p| most.max(p));
    let pad = ROUNDING * largest.element_sum();
    let mut extents = [NOWHERE; 4 + Slabs::MOST];
    let (of_piece, of_slabs) = extents.split_at_mut(usize::from(piece.is_some()));
    of_piece.fill([piece.unwrap_or(0) as f32; 2]);
    for (extent, direction) in of_slabs.iter_mut().zip(&slabs.0) {
        let [a, b, c] = corners.map(|p| p.dot(*direction));
        *extent = [a.min(b).min(c) - pad, a.max(b).max(c) + pad];
    }
    extents
}

/// Triangles among which pairs are looked for; fast where neighbours in the list lie near each other.
#[derive(Clone, Copy)]
pub(super) struct Suspects<'a> {
    pub(super) triangles: &'a [u32],
    /// Which of them are known to be clear of each other: pairs of two are not looked for.
    pub(super) cleared: &'a (dyn Fn(u32) -> bool + Sync),
    /// Which piece of the skin each belongs to, if pairs of different pieces are not looked for either; fast where those of a
    /// piece follow each other.
    pub(super) pieces: Option<&'a Pieces<'a>>,
}

impl<'a> Suspects<'a> {
    /// Of these triangles nothing is known.
    pub(super) fn all_of(triangles: &'a [u32]) -> Self {
        Self { triangles, cleared: &|_| false, pieces: None }
    }
}

/// The piece of a triangle, a number below two to the 24th.
pub(super) type Pieces<'a> = dyn Fn(u32) -> u32 + Sync + 'a;

/// The same among some triangles.
pub(super) fn intersecting_pairs_of(
    places: &[Vec3],
    triangles: &[[u32; 3]],
    Suspects { triangles: among, cleared, pieces }: Suspects<'_>,
    slabs: &Slabs,
) -> Vec<[u32; 2]> {
    if among.is_empty() {
        return Vec::new();
    }
    let fresh = fresh(among, cleared);
    if fresh[fresh.len() - 1][0] == 0 {
        return Vec::new();
    }
    let tree = Tree::new(slabs, places, triangles, among, pieces);
    let search = Search { places, triangles, among, tree, fresh };
    let of_leaf = |leaf: usize| {
        let mut pairs = Vec::new();
        search.descend(search.tree.levels.len() - 1, 0, leaf, &search.tree.leaves[leaf], &mut pairs);
        pairs
    };
    let leaves = among.len().div_ceil(WIDE);
    let found = (0..leaves).into_par_iter().with_min_len(RUN).flat_map_iter(of_leaf);
    let mut pairs: Vec<[u32; 2]> = found.collect();
    pairs.sort_unstable();
    pairs
}

struct Search<'a> {
    places: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    among: &'a [u32],
    tree: Tree,
    /// Of every node: a bit for each child with triangles that are not cleared.
    fresh: Vec<Vec<u32>>,
}

impl Search<'_> {
    /// Compares the triangles of leaf `own`, which lie within `extents`, with those under a node that do not come before it.
    fn descend(&self, level: usize, node: usize, own: usize, extents: &Extents, pairs: &mut Vec<[u32; 2]>) {
        let worth = if self.fresh[0][own] == 0 { self.fresh[level][node] } else { !0 };
        if worth == 0 {
            return;
        }
        let near = worth & self.tree.overlapping(level, node, extents);
        if level == 0 {
            return self.compare(own, node, near, pairs);
        }
        for child in ones(near).map(|k| node * WIDE + k) {
            if (child + 1) * WIDE.pow(level as u32 - 1) > own {
                self.descend(level - 1, child, own, extents, pairs);
            }
        }
    }

    /// Compares the triangles of leaf `own` with those of `near`, bits of another leaf.
    fn compare(&self, own: usize, other: usize, near: u32, pairs: &mut Vec<[u32; 2]>) {
        let group = &self.among[own * WIDE..self.among.len().min((own + 1) * WIDE)];
        for (i, &a) in group.iter().enumerate() {
            let later = if own == other { near & (!1 << i) } else { near };
            let is_fresh = self.fresh[0][own] >> i & 1 == 1;
            let later = if is_fresh { later } else { later & self.fresh[0][other] };
            if later == 0 {
                continue;
            }
            for k in ones(later & self.tree.overlapping(0, other, &self.tree.extents[own * WIDE + i])) {
                let b = self.among[other * WIDE + k];
                if self.intersect(a, b) {
                    pairs.push([a.min(b), a.max(b)]);
                }
            }
        }
    }

    /// Whether an edge of one passes through the inside of the other. Triangles that share a corner never count.
    fn intersect(&self, s: u32, t: u32) -> bool {
        let ([a, b, c], t) = (self.triangles[s as usize], self.triangles[t as usize]);
        if t.iter().fold(false, |shared, &i| shared | (i == a) | (i == b) | (i == c)) {
            return false;
        }
        let [s, t] = [[a, b, c], t].map(|corners| corners.map(|i| self.places[i as usize].as_dvec3()));
        if on_one_side(&s, &t) || on_one_side(&t, &s) {
            return false;
        }
        (0..3).any(|k| passes(s[k], s[(k + 1) % 3], &t) || passes(t[k], t[(k + 1) % 3], &s))
    }
}

/// Level by level, a bit for each child of a node that has triangles that are not cleared.
fn fresh(among: &[u32], cleared: &(dyn Fn(u32) -> bool + Sync)) -> Vec<Vec<u32>> {
    let bits = |eight: &[bool]| eight.iter().enumerate().fold(0, |bits, (k, &is)| bits | u32::from(is) << k);
    let mut below: Vec<bool> = among.iter().map(|&t| !cleared(t)).collect();
    let mut levels: Vec<Vec<u32>> = vec![below.chunks(WIDE).map(bits).collect()];
    while levels[levels.len() - 1].len() > 1 {
        below = levels[levels.len() - 1].iter().map(|&bits| bits != 0).collect();
        levels.push(below.chunks(WIDE).map(bits).collect());
    }
    levels
}

/// Which bits are set.
fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let k = bits.trailing_zeros() as usize;
        (bits != 0).then(|| {
            bits &= bits - 1;
            k
        })
    })
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
