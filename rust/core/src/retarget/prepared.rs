//! Both characters checked and welded, and the steps that need both.

use glam::DVec3;

use super::biharmonic::{Blend, Described, blends, check_landmarks, landmarks_of_matches};
use super::placed::Placed;
use super::rows::{Row, blended};
use super::shares::Shares;
use super::skeleton::{Guide, RestBone, guides, pairs};
use super::warp::Warp;
use super::{Character, Correspondence, Landmark, Report, Settings};
use crate::adjacency::{Islands, NONE};
use crate::biharmonic::BiharmonicEmbedding;
use crate::error::{Error, Result};
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::registration::Match;
use crate::weights::Weights;
use crate::welded::Welded;

/// Everything that is known before the first vertex is matched.
#[derive(Debug)]
pub(super) struct Prepared<'a> {
    pub characters: [Character<'a>; 2],
    weights: &'a Weights,
    correspondence: Correspondence<'a>,
    pub settings: &'a Settings,
    /// Pairs whose source bone holds weight: they guide the warp.
    pub guides: Vec<Guide>,
    shares: Shares<'a>,
    pub warp: Warp,
    pub source: Welded,
    /// The target's distinct positions.
    pub target: Welded,
    /// Diagonal of the source.
    pub size: f64,
}

impl<'a> Prepared<'a> {
    pub fn new(
        source: Character<'a>,
        weights: &'a Weights,
        target: Character<'a>,
        correspondence: Correspondence<'a>,
        settings: &'a Settings,
    ) -> Result<Self> {
        settings.check()?;
        check_weights(source, weights)?;
        check_landmarks(correspondence.landmarks, source.mesh.vertex_count(), target.mesh.vertex_count())?;
        let pairs = pairs(correspondence.bone_map, source.skeleton, target.skeleton)?;
        let parents = correspondence.source_parents;
        if let Some(found) = parents.map(<[i32]>::len).filter(|&found| found != source.skeleton.bones().len()) {
            let expected = source.skeleton.bones().len();
            return Err(Error::LengthMismatch { what: "source_parents", found, expected });
        }
        let weighted = weighted_bones(weights);
        let guides = guides(&pairs, source.skeleton, target.skeleton, &weighted);
        if guides.is_empty() {
            return Err(Error::NoCommonBones);
        }
        Ok(Self {
            shares: Shares::new(&pairs, source.skeleton, target.skeleton, parents, &weighted),
            warp: Warp::new(&guides),
            size: source.mesh.diagonal(),
            source: Welded::new(&source.mesh),
            target: Welded::new(&target.mesh),
            characters: [source, target],
            weights,
            correspondence,
            settings,
            guides,
        })
    }

    /// What is known before the work starts.
    pub fn report(&self) -> Report {
        let without = |(target, source): (u32, &i32)| (*source < 0).then_some(target);
        Report {
            vertices: self.target.of_vertex.len(),
            bones: self.guides.len(),
            size_ratio: self.warp.across(),
            inherited: self.shares.inherited.clone(),
            without_partner: (0..).zip(self.correspondence.bone_map).filter_map(without).collect(),
            ..Report::default()
        }
    }

    /// The weights of each match over the target's bones (U).
    pub fn rows_of(&self, matches: &[Match]) -> Vec<Row> {
        let corners = matches.iter().map(|at| std::iter::zip(at.corners, at.barycentric));
        let row = |(blend, &position): (_, &DVec3)| blended(blend, self.weights, &self.shares, position);
        corners.zip(&self.target.positions).map(row).collect()
    }

    /// Replaces matches and rows (U) of islands with landmarks by those of the biharmonic matching. Returns the numbers of
    /// landmarks and of vertices concerned.
    pub fn replace_by_landmarks(
        &self,
        placed: &mut Placed,
        rows: &mut [Row],
        progress: &Progress,
    ) -> Result<(usize, usize)> {
        let landmarks = self.landmarks(placed);
        let mut count = 0;
        for (blend, &u) in std::iter::zip(self.blends(placed, &landmarks, progress)?, &self.target.of_vertex) {
            if let Some(blend) = blend {
                let position = self.target.positions[u as usize];
                self.rematch(placed, u as usize, &blend);
                rows[u as usize] = blended(blend.into_iter(), self.weights, &self.shares, position);
                count += 1;
            }
        }
        Ok((landmarks.len(), count))
    }

    /// The source vertices of each vertex of the target (V), None where the match by the skeleton stands: on islands without
    /// enough landmarks, and where that match is on another island, as characters may be cut into islands differently.
    fn blends(&self, placed: &Placed, landmarks: &[Landmark], progress: &Progress) -> Result<Vec<Option<Blend>>> {
        let [source, target] = self.characters;
        let (source_spectrum, islands) = self.spectrum(&source.mesh, &self.source, progress)?;
        let (target_spectrum, target_islands) = self.spectrum(&target.mesh, &self.target, progress)?;
        // One vertex of each place is a candidate, or its copies would crowd out the next ones.
        let first = self.source.spread(&self.source.first);
        let candidate = |(i, &island): (usize, &u32)| if first[i] as usize == i { island } else { NONE };
        let one = |l: &Landmark| Landmark { source: first[l.source as usize], ..*l };
        let landmarks: Vec<Landmark> = landmarks.iter().map(one).collect();
        let mut blends = blends(
            &Described {
                embedding: &source_spectrum,
                islands: &islands.iter().enumerate().map(candidate).collect::<Vec<_>>(),
                normals: &self.source.spread(&placed.source_normals),
                regions: &self.regions(&self.source, 0),
            },
            &Described {
                embedding: &target_spectrum,
                islands: &target_islands,
                normals: &self.target.spread(&placed.normals),
                regions: &self.regions(&self.target, 1),
            },
            &landmarks,
            self.correspondence.landmarks.len(),
            progress,
        )?;
        for (blend, &u) in std::iter::zip(&mut blends, &self.target.of_vertex) {
            let by_skeleton = islands[placed.matches[u as usize].corners[0] as usize];
            *blend = blend.filter(|blend| islands[blend[0].0 as usize] == by_skeleton);
        }
        progress.check()?;
        Ok(blends)
    }

    /// Biharmonic coordinates and island of every vertex (V) of a mesh whose coincident vertices are one.
    fn spectrum(
        &self,
        mesh: &TriMesh<'_>,
        welded: &Welded,
        progress: &Progress,
    ) -> Result<(BiharmonicEmbedding, Vec<u32>)> {
        let first: Vec<u32> = welded.spread(&welded.first);
        let triangles: Vec<[u32; 3]> = mesh.triangles().iter().map(|t| t.map(|i| first[i as usize])).collect();
        let whole = TriMesh::new(mesh.positions(), &triangles, "welded")?;
        let islands = Islands::new(&triangles, first.len());
        let of_vertex = first.iter().map(|&i| islands.of_vertex()[i as usize]).collect();
        Ok((BiharmonicEmbedding::new(&whole, self.settings.n_pairs, progress)?.at(&first), of_vertex))
    }

    /// Moves the match of a distinct position of the target to a blend of source vertices. How far the skeleton would have
    /// put it from there says nothing.
    fn rematch(&self, placed: &mut Placed, u: usize, blend: &Blend) {
        let (mut position, mut normal) = (DVec3::ZERO, DVec3::ZERO);
        for &(vertex, share) in blend.iter().filter(|(_, share)| *share > 0.0) {
            let at = self.source.of_vertex[vertex as usize] as usize;
            position += share * self.source.positions[at];
            normal += share * placed.source_normals[at].as_dvec3();
        }
        let cosine = normal.normalize_or_zero().dot(placed.normals[u].as_dvec3());
        placed.matches[u] = Match { position, cosine, ..placed.matches[u] };
        placed.gaps[u] = 0.0;
    }

    /// Those of the artist, and one beside the head of each bone that guides.
    fn landmarks(&self, placed: &Placed) -> Vec<Landmark> {
        let squared = |u: &usize, head: DVec3| self.target.positions[*u].distance_squared(head);
        let nearest = |head: DVec3| {
            (0..self.target.positions.len()).min_by(|a, b| squared(a, head).total_cmp(&squared(b, head))).unwrap_or(0)
        };
        let beside: Vec<usize> = self.guides.iter().map(|guide| nearest(guide.target.head)).collect();
        let vertices: Vec<u32> = beside.iter().map(|&u| self.target.first[u]).collect();
        let matches: Vec<Match> = beside.iter().map(|&u| placed.matches[u]).collect();
        let mut landmarks = self.correspondence.landmarks.to_vec();
        landmarks.extend(landmarks_of_matches(&vertices, &matches));
        landmarks
    }

    /// The nearest two guides of each vertex; `side` 0 is the source, 1 the target.
    fn regions(&self, welded: &Welded, side: usize) -> Vec<[u32; 2]> {
        let of_side = |guide: &Guide| [guide.source, guide.target][side];
        let guides: Vec<RestBone> = self.guides.iter().map(of_side).collect();
        let nearest = |&p: &DVec3| {
            let mut best = [(f64::INFINITY, 0); 2];
            for (k, bone) in (0..).zip(&guides) {
                let entry = (bone.distance(p), k);
                if entry.0 < best[0].0 {
                    best = [entry, best[0]];
                } else if entry.0 < best[1].0 {
                    best[1] = entry;
                }
            }
            best.map(|(_, k)| k)
        };
        welded.spread(&welded.positions.iter().map(nearest).collect::<Vec<_>>())
    }
}

fn check_weights(source: Character<'_>, weights: &Weights) -> Result<()> {
    let (found, expected) = (weights.vertex_count(), source.mesh.vertex_count());
    if found != expected {
        return Err(Error::LengthMismatch { what: "source weights", found, expected });
    }
    let (found, expected) = (weights.n_bones() as usize, source.skeleton.bones().len());
    if found != expected {
        return Err(Error::LengthMismatch { what: "source frames", found: expected, expected: found });
    }
    weights.check_not_negative()
}

/// Which bones hold any weight.
fn weighted_bones(weights: &Weights) -> Vec<bool> {
    let mut weighted = vec![false; weights.n_bones() as usize];
    let entries = std::iter::zip(weights.bones(), weights.values());
    entries.filter(|(_, value)| **value > 0.0).for_each(|(&bone, _)| weighted[bone as usize] = true);
    weighted
}
