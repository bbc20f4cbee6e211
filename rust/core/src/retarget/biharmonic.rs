//! Matching by biharmonic distances to landmarks.
//!
//! Pan, Chen, Yang and Qin, Automatic skinning and weight retargeting of articulated characters using extended position-based
//! dynamics, The Visual Computer 34, 2018, doi:10.1007/s00371-017-1441-1, section 5: a vertex is described by its distances to
//! the landmarks, divided by the largest of them (Eqs. 20, 21), and takes its weights from the four source vertices whose
//! descriptions differ least (Eqs. 22, 23), searched within the corresponding region. What is different here: descriptions
//! hold logarithms, such that the landmarks nearby decide and the proportions of far limbs do not; landmarks are spread over
//! the surface, as fingers and faces have most of the bones; descriptions hold the normals in the source's pose too, for
//! front and back of a body are alike in distance; regions overlap; the four are weighed by the difference of their
//! descriptions, which the paper's own distance to the best match would make 1/0; and each island has a spectrum of its own.

use glam::Vec3;
use rayon::prelude::*;

use crate::biharmonic::BiharmonicEmbedding;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::registration::Match;

/// Source vertices that are blended.
pub const BEST: usize = 4;
/// Weight of a unit of normal difference beside the logarithms of distances.
const ORIENTATION: f64 = 1.0;
/// Share of the largest distance below which a landmark does not tell places apart any more.
const BESIDE: f64 = 0.02;
/// Landmarks of an island that are used.
const MOST: usize = 48;
/// Difference of descriptions below which a match does not gain any more.
const GUARD: f64 = 1e-3;
/// Landmarks without which an island is left to the skeleton.
const FEWEST: usize = 3;

/// A source vertex and the target vertex that corresponds to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Landmark {
    /// Index among the source's vertices.
    pub source: u32,
    /// Index among the target's vertices.
    pub target: u32,
}

/// One side of the matching, per vertex.
#[derive(Debug)]
pub struct Described<'a> {
    /// Coordinates of the biharmonic distance.
    pub embedding: &'a BiharmonicEmbedding,
    /// Island of each vertex, `NONE` for one without a triangle (V).
    pub islands: &'a [u32],
    /// Unit normals in the source's pose (V).
    pub normals: &'a [Vec3],
    /// The nearest two bones of each vertex, as pair numbers (V).
    pub regions: &'a [[u32; 2]],
}

/// Source vertices and their shares for one target vertex.
pub type Blend = [(u32, f64); BEST];

/// Checks that landmarks (L) name vertices.
///
/// # Errors
/// [`Error::InvalidParameter`].
pub fn check_landmarks(landmarks: &[Landmark], source_count: usize, target_count: usize) -> Result<()> {
    for landmark in landmarks {
        for (vertex, count) in [(landmark.source, source_count), (landmark.target, target_count)] {
            if vertex as usize >= count {
                let must = "a landmark must name a vertex of the source and one of the target";
                return Err(Error::InvalidParameter { name: "landmarks", value: f64::from(vertex), must });
            }
        }
    }
    Ok(())
}

/// Landmarks from a few target vertices and the matches that the skeleton gives them: the corner that is nearest.
pub fn landmarks_of_matches(vertices: &[u32], matches: &[Match]) -> Vec<Landmark> {
    let landmark = |(&target, at): (&u32, &Match)| {
        let nearest = (0..3).max_by(|&a, &b| at.barycentric[a].total_cmp(&at.barycentric[b])).expect("three corners");
        Landmark { source: at.corners[nearest], target }
    };
    vertices.iter().zip(matches).map(landmark).collect()
}

/// The blend for each vertex of the target (V), None where its island has too few landmarks on one island of the source. The
/// first `given` landmarks are the artist's.
///
/// # Errors
/// [`Error::Cancelled`].
pub fn blends(
    source: &Described<'_>,
    target: &Described<'_>,
    landmarks: &[Landmark],
    given: usize,
    progress: &Progress,
) -> Result<Vec<Option<Blend>>> {
    let mut blends = vec![None; target.islands.len()];
    for (target_island, source_island) in island_pairs(source, target, landmarks) {
        let on_both = |l: &Landmark| {
            target.islands[l.target as usize] == target_island && source.islands[l.source as usize] == source_island
        };
        let kept = landmarks[..given].iter().filter(|l| on_both(l)).count();
        let own = spread(landmarks.iter().filter(|l| on_both(l)).copied().collect(), kept, target.embedding);
        let ends = |of: fn(&Landmark) -> u32| own.iter().map(of).collect::<Vec<u32>>();
        progress.check()?;
        let source_rows = Descriptions::new(source, source_island, &ends(|l| l.source));
        progress.check()?;
        let target_rows = Descriptions::new(target, target_island, &ends(|l| l.target));
        let candidates = source_rows.by_region(source);
        let best = |(k, &i): (usize, &u32)| {
            progress.check()?;
            let near = target.regions[i as usize].iter().filter_map(|&r| candidates.get(r as usize));
            Ok(source_rows.nearest(target_rows.row(k), &near.map(Vec::as_slice).collect::<Vec<_>>()))
        };
        let found: Vec<Blend> = target_rows.vertices.par_iter().enumerate().map(best).collect::<Result<_>>()?;
        for (&i, blend) in target_rows.vertices.iter().zip(found) {
            blends[i as usize] = Some(blend);
        }
    }
    Ok(blends)
}

/// The first `kept` landmarks, then always the one that is farthest from those chosen, [`MOST`] in all.
fn spread(landmarks: Vec<Landmark>, kept: usize, embedding: &BiharmonicEmbedding) -> Vec<Landmark> {
    let count = MOST.max(kept);
    if landmarks.len() <= count {
        return landmarks;
    }
    let mut gaps = vec![f64::INFINITY; landmarks.len()];
    let (mut chosen, mut next) = (Vec::with_capacity(count), 0);
    while chosen.len() < count {
        let place = landmarks[next].target as usize;
        chosen.push(landmarks[next]);
        for (gap, other) in gaps.iter_mut().zip(&landmarks) {
            *gap = gap.min(embedding.distance(place, other.target as usize));
        }
        // Of equal gaps the first, for any number of threads.
        let farthest = (0..gaps.len()).rev().max_by(|&a, &b| gaps[a].total_cmp(&gaps[b])).expect("there are landmarks");
        next = if chosen.len() < kept { chosen.len() } else { farthest };
    }
    chosen
}

/// Islands of the target and the island of the source that most of their landmarks are on, where those are enough.
fn island_pairs(source: &Described<'_>, target: &Described<'_>, landmarks: &[Landmark]) -> Vec<(u32, u32)> {
    let mut votes = std::collections::BTreeMap::<(u32, u32), usize>::new();
    for l in landmarks {
        let islands = (target.islands[l.target as usize], source.islands[l.source as usize]);
        if islands.0 != crate::adjacency::NONE && islands.1 != crate::adjacency::NONE {
            *votes.entry(islands).or_default() += 1;
        }
    }
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    let mut most = 0;
    for (&(t, s), &count) in &votes {
        if pairs.last().is_some_and(|last| last.0 == t) {
            if count > most {
                *pairs.last_mut().expect("there is one") = (t, s);
                most = count;
            }
        } else {
            most = count;
            pairs.push((t, s));
        }
    }
    pairs.retain(|pair| votes[pair] >= FEWEST);
    pairs
}

/// Descriptions of the vertices of an island.
struct Descriptions {
    vertices: Vec<u32>,
    width: usize,
    values: Vec<f32>,
}

impl Descriptions {
    /// Logarithms of the distances to `landmarks`, divided by the largest, and the normal.
    fn new(side: &Described<'_>, island: u32, landmarks: &[u32]) -> Self {
        let vertices: Vec<u32> =
            (0..side.islands.len() as u32).filter(|&i| side.islands[i as usize] == island).collect();
        let row = |&i: &u32| {
            let distances: Vec<f64> =
                landmarks.iter().map(|&j| side.embedding.distance(i as usize, j as usize)).collect();
            let largest = distances.iter().fold(0.0f64, |most, &x| most.max(x)).max(f64::MIN_POSITIVE);
            let normal = side.normals[i as usize].to_array().map(|x| (ORIENTATION * f64::from(x)) as f32);
            distances.into_iter().map(move |d| (d / largest + BESIDE).ln() as f32).chain(normal).collect::<Vec<f32>>()
        };
        let values = vertices.par_iter().flat_map_iter(row).collect();
        Self { vertices, width: landmarks.len() + 3, values }
    }

    fn row(&self, k: usize) -> &[f32] {
        &self.values[k * self.width..][..self.width]
    }

    /// Places of the vertices by each of their regions.
    fn by_region(&self, side: &Described<'_>) -> Vec<Vec<u32>> {
        let count = side.regions.iter().flatten().map(|&r| r as usize + 1).max().unwrap_or(0);
        let mut places = vec![Vec::new(); count];
        for (k, &i) in self.vertices.iter().enumerate() {
            for &region in &side.regions[i as usize] {
                let list = &mut places[region as usize];
                if list.last() != Some(&(k as u32)) {
                    list.push(k as u32);
                }
            }
        }
        places
    }

    /// The best places among `candidates`, or among all where there are too few, blended by the inverse difference.
    fn nearest(&self, wanted: &[f32], candidates: &[&[u32]]) -> Blend {
        let mut best = [(f32::INFINITY, u32::MAX); BEST];
        let mut consider = |k: u32| {
            let squared = squared_difference(self.row(k as usize), wanted, best[BEST - 1].0);
            if squared < best[BEST - 1].0 && best.iter().all(|b| b.1 != k) {
                best[BEST - 1] = (squared, k);
                best.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            }
        };
        if candidates.iter().map(|list| list.len()).sum::<usize>() > 2 * BEST {
            candidates.iter().copied().flatten().for_each(|&k| consider(k));
        } else {
            (0..self.vertices.len() as u32).for_each(consider);
        }
        let share = |squared: f32| if squared.is_finite() { 1.0 / (f64::from(squared).sqrt() + GUARD) } else { 0.0 };
        let total: f64 = best.iter().map(|b| share(b.0)).sum();
        best.map(|(squared, k)| (self.vertices.get(k as usize).copied().unwrap_or(u32::MAX), share(squared) / total))
    }
}

/// The sum of squared differences, or as much of it as shows that it is not less than `limit`.
fn squared_difference(a: &[f32], b: &[f32], limit: f32) -> f32 {
    let mut sum = 0.0;
    for (a, b) in a.chunks(8).zip(b.chunks(8)) {
        sum += a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f32>();
        if sum >= limit {
            break;
        }
    }
    sum
}
