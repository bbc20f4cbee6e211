//! Skin that has come through skin, in a fold of a crease, limb against limb or limb against torso, is pushed back out,
//! both sides alike, and smoothed where that happened.

use std::collections::HashSet;

use glam::Vec3;

use super::pairs::{Slabs, Suspects, intersecting_pairs, intersecting_pairs_of};
use super::skin::{Skin, all_triangles, by_island, corners, grown};
use super::surface::Surface;

/// Rounds of pushing without fewer pairs, after which another width is tried.
const STALLED: usize = 5;
/// How many rings around are smoothed, in the order they are tried: a fold is wider than it looks, and skin that is
/// pressed against what may not move gets worse by smoothing.
///
/// One of them smooths and pushes nothing (step 0): it takes more rounds and more volume, but diverges less often.
const TRIES: [(usize, f32); 6] = [(1, STEP), (3, 0.0), (0, STEP), (2, STEP), (3, STEP), (4, STEP)];
/// The widest smoothing, as a share of how far skin may move: edges of coarse skin are longer, and a ring of them is a limb.
const WIDEST: f32 = 1.4;
/// How far a round pushes, as a share of the mean edge of the triangles in each other.
const STEP: f32 = 0.15;
/// How far a round moves them and the ring around towards the mean of their neighbours.
const SMOOTHING: f32 = 0.3;
/// Times that it is looked whether pushing has made other pairs.
const CHECKS: usize = 3;
/// Rings around the first contacts in which new ones are looked for.
const RINGS: usize = 10;

/// Pairs of triangles in contact at rest already, which are left as they are.
#[derive(Debug, Default)]
pub(super) struct Contact {
    at_rest: HashSet<[u32; 2]>,
}

/// How far folds are pushed.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    /// No vertex moves farther.
    pub(super) farthest: f32,
    /// No more rounds of pushing follow on each other.
    pub(super) rounds: usize,
}

impl Contact {
    pub(super) fn new(surface: &Surface) -> Self {
        let rest: Vec<[f32; 3]> = surface.rest.iter().map(|place| place.as_vec3().to_array()).collect();
        Self { at_rest: intersecting_pairs(&rest, &surface.triangles).into_iter().collect() }
    }

    /// Pairs of one piece among all triangles of the skin that do not intersect at rest.
    pub(super) fn all_own_pairs(&self, skin: &dyn Skin, places: &[Vec3], slabs: &Slabs) -> Vec<[u32; 2]> {
        self.own_pairs(skin, places, Suspects::all_of(&all_triangles(skin)), slabs)
    }

    /// The same after some vertices have `moved`, given the pairs `before`.
    pub(super) fn all_own_pairs_again(
        &self,
        skin: &dyn Skin,
        places: &[Vec3],
        since: (Vec<[u32; 2]>, &[u32]),
        slabs: &Slabs,
    ) -> Vec<[u32; 2]> {
        self.own_pairs_again(skin, places, &all_triangles(skin), since, slabs)
    }

    /// Pairs of one piece of skin. Layers of cloth that come through each other do so because their weights differ, and
    /// which is the outer one cannot be told: pushing and smoothing would eat them up.
    pub(super) fn own_pairs(
        &self,
        skin: &dyn Skin,
        places: &[Vec3],
        among: Suspects<'_>,
        slabs: &Slabs,
    ) -> Vec<[u32; 2]> {
        let island = |t: u32| skin.island(t);
        let of_one_piece = Suspects { pieces: Some(&island), ..among };
        let mut pairs = intersecting_pairs_of(places, skin.triangles(), of_one_piece, slabs);
        pairs.retain(|&[a, b]| {
            let [a, b] = [skin.name(a), skin.name(b)];
            !self.at_rest.contains(&[a.min(b), a.max(b)])
        });
        pairs
    }

    /// The same among some triangles.
    fn own_pairs_again(
        &self,
        skin: &dyn Skin,
        places: &[Vec3],
        among: &[u32],
        (before, moved): (Vec<[u32; 2]>, &[u32]),
        slabs: &Slabs,
    ) -> Vec<[u32; 2]> {
        let mut has_moved = vec![false; places.len()];
        moved.iter().for_each(|&i| has_moved[i as usize] = true);
        let is_still = |t: u32| skin.triangles()[t as usize].iter().all(|&i| !has_moved[i as usize]);
        let mut pairs = self.own_pairs(skin, places, Suspects { cleared: &is_still, ..Suspects::all_of(among) }, slabs);
        pairs.extend(before.into_iter().filter(|pair| pair.iter().all(|&t| is_still(t))));
        pairs.sort_unstable();
        pairs
    }

    /// Pushes until no pair of the `suspects` intersects that does not at rest; if some remain, the round with the fewest counts.
    /// Returns the vertices that moved, ascending, and the number of pairs that remain.
    ///
    /// No vertex moves farther than `effort` says: where whole layers of cloth lie in each other, smoothing would go on until
    /// nothing is left of them.
    pub(super) fn part(
        &self,
        skin: &dyn Skin,
        places: &mut Vec<Vec3>,
        suspects: Suspects<'_>,
        effort: Effort,
        slabs: &Slabs,
    ) -> (Vec<u32>, usize) {
        let triangles = by_island(skin, suspects.triangles.to_vec());
        let suspects = Suspects { triangles: &triangles, ..suspects };
        let (mut pairs, mut moved) = (self.own_pairs(skin, places, suspects, slabs), Vec::new());
        for _ in 0..CHECKS {
            if pairs.is_empty() {
                break;
            }
            let (pushed, left) = self.push_apart(skin, places, pairs, effort, slabs);
            moved.extend(&pushed);
            pairs = left;
            if !pairs.is_empty() {
                break;
            }
            // Pushing looks around the pairs alone, and may have pressed them into what lies on the other side.
            pairs = self.own_pairs_again(skin, places, &triangles, (pairs, &pushed), slabs);
        }
        moved.sort_unstable();
        moved.dedup();
        (moved, pairs.len())
    }

    /// Pushes `pairs` apart; returns the vertices that moved, and the pairs that remain around them.
    fn push_apart(
        &self,
        skin: &dyn Skin,
        places: &mut Vec<Vec3>,
        mut pairs: Vec<[u32; 2]>,
        Effort { farthest, mut rounds }: Effort,
        slabs: &Slabs,
    ) -> (Vec<u32>, Vec<[u32; 2]>) {
        let around = grown(skin, corners(skin, &pairs), RINGS);
        let near: HashSet<u32> = around.iter().copied().collect();
        let is_near = |&t: &u32| skin.triangles()[t as usize].iter().any(|i| near.contains(i));
        let among = by_island(skin, (0..skin.triangles().len() as u32).filter(is_near).collect());
        let most_rings = (WIDEST * farthest / mean_edge(skin, places, &pairs)).round().max(1.0) as usize;
        let (start, mut moved) = (places.clone(), Vec::new());
        // More than the suspects' own.
        let mut known = self.own_pairs(skin, places, Suspects::all_of(&among), slabs);
        for (rings, step) in TRIES.into_iter().filter(|&(rings, _)| rings <= most_rings) {
            let (mut now, mut left, mut all, mut stalled) = (places.clone(), pairs.clone(), known.clone(), 0);
            while stalled < STALLED && !pairs.is_empty() && rounds > 0 {
                rounds -= 1;
                let pushed = push(skin, &mut now, &left, rings, step);
                for &i in &pushed {
                    let from = start[i as usize];
                    now[i as usize] = from + (now[i as usize] - from).clamp_length_max(farthest);
                }
                all = self.own_pairs_again(skin, &now, &among, (all, &pushed), slabs);
                moved.extend(pushed);
                left.clone_from(&all);
                stalled += 1;
                if left.len() < pairs.len() {
                    stalled = 0;
                    pairs.clone_from(&left);
                    known.clone_from(&left);
                    places.clone_from(&now);
                }
                if left.is_empty() {
                    break;
                }
            }
        }
        (moved, pairs)
    }
}

/// One round: the triangles of a pair move apart along the difference of their normals, then they and some `rings` around
/// are smoothed as many times: a fold that stays is wider than it looks. Returns what moved.
fn push(skin: &dyn Skin, places: &mut [Vec3], pairs: &[[u32; 2]], rings: usize, step: f32) -> Vec<u32> {
    let triangle = |t: u32| skin.triangles()[t as usize];
    let normal = |t: u32| {
        let [a, b, c] = triangle(t).map(|i| places[i as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let touched = corners(skin, pairs);
    let mut pushes = vec![Vec3::ZERO; touched.len()];
    for &[a, b] in pairs {
        let apart = (normal(b) - normal(a)).normalize_or_zero();
        for (t, by) in [(a, apart), (b, -apart)] {
            for i in triangle(t) {
                pushes[touched.binary_search(&i).expect("a corner")] += by;
            }
        }
    }
    let step = step * mean_edge(skin, places, pairs);
    for (&i, by) in touched.iter().zip(&pushes).filter(|(i, _)| skin.is_free(**i)) {
        places[i as usize] += by.normalize_or_zero() * step;
    }
    let near = grown(skin, touched, rings);
    for _ in 0..rings {
        smooth(skin, places, &near);
    }
    near
}

/// The mean length of edges of triangles that pass through each other.
fn mean_edge(skin: &dyn Skin, places: &[Vec3], pairs: &[[u32; 2]]) -> f32 {
    let edge = |&t: &u32| {
        let [i, j, _] = skin.triangles()[t as usize].map(|i| places[i as usize]);
        i.distance(j)
    };
    let sum: f32 = pairs.as_flattened().iter().map(edge).sum();
    (sum / (2 * pairs.len()) as f32).max(f32::MIN_POSITIVE)
}

fn smooth(skin: &dyn Skin, places: &mut [Vec3], vertices: &[u32]) {
    let mean = |&i: &u32| {
        let ring = skin.ring(i);
        let sum: Vec3 = ring.iter().map(|&n| places[n as usize]).sum();
        if ring.is_empty() { Vec3::ZERO } else { (sum / ring.len() as f32 - places[i as usize]) * SMOOTHING }
    };
    let moves: Vec<Vec3> = vertices.iter().map(mean).collect();
    for (&i, by) in vertices.iter().zip(moves).filter(|(i, _)| skin.is_free(**i)) {
        places[i as usize] += by;
    }
}
