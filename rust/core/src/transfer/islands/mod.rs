//! Islands without a single match have no equation (the paper's stated limitation). They get weights by a policy.

mod bounds;
mod gap_tree;
mod near_surface;
mod policy;
mod spanning_tree;

pub use policy::IslandPolicy;

use rayon::prelude::*;

use super::Source;
use crate::adjacency::{Islands, NONE};
use crate::error::Result;
use crate::fill::Row;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::surface::SurfacePoint;
use crate::weights::Weights;
use policy::Answer;
use spanning_tree::SpanningTree;

/// One island without a match and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct UnmatchedIsland {
    /// Its smallest vertex.
    pub first_vertex: u32,
    /// Number of its vertices.
    pub vertices: usize,
    /// The policy that gave it its weights; differs from the one asked for where that one had nothing to give.
    pub policy: IslandPolicy,
}

/// The target as the island step sees it.
pub(super) struct Scene<'a> {
    pub source: &'a Source,
    /// Clean triangles.
    pub mesh: TriMesh<'a>,
    pub islands: &'a Islands,
    /// Closest source point of each vertex.
    pub points: &'a [SurfacePoint],
    /// Whether an island holds a match.
    pub has_match: &'a [bool],
    /// Gap, world units, over which an island hangs on the garment even if the body is nearer.
    pub max_distance: f64,
}

/// The vertices of the islands without a match, by island.
pub(super) struct Unmatched {
    /// Number of each island in this list, [`NONE`] for one with a match.
    number: Vec<u32>,
    starts: Vec<u32>,
    vertices: Vec<u32>,
}

impl Unmatched {
    fn new(scene: &Scene<'_>) -> Self {
        let mut number = vec![NONE; scene.islands.count()];
        let unmatched = (0..number.len()).filter(|&island| !scene.has_match[island]);
        let count = std::iter::zip(0.., unmatched).map(|(k, island)| number[island] = k).count();
        let mut starts = vec![0u32; count + 1];
        let number_of = |island: u32| if island == NONE { NONE } else { number[island as usize] };
        let numbers = || scene.islands.of_vertex().iter().map(|&island| number_of(island)).zip(0..);
        numbers().filter(|&(k, _)| k != NONE).for_each(|(k, _)| starts[k as usize + 1] += 1);
        (0..count).for_each(|k| starts[k + 1] += starts[k]);
        let (mut next, mut vertices) = (starts.clone(), vec![0; starts[count] as usize]);
        for (k, i) in numbers().filter(|&(k, _)| k != NONE) {
            vertices[next[k as usize] as usize] = i;
            next[k as usize] += 1;
        }
        Self { number, starts, vertices }
    }

    fn count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The vertices of island `k` of the list, ascending.
    fn members(&self, k: usize) -> &[u32] {
        &self.vertices[self.range(k)]
    }

    fn range(&self, k: usize) -> std::ops::Range<usize> {
        self.starts[k] as usize..self.starts[k + 1] as usize
    }
}

impl Scene<'_> {
    /// Fills the rows of islands without a match, and of loose vertices (always from their closest point). Returns the
    /// islands concerned.
    ///
    /// # Errors
    /// [`crate::Error::Cancelled`].
    pub fn fill(
        &self,
        weights: Weights,
        policy: IslandPolicy,
        progress: &Progress,
    ) -> Result<(Weights, Vec<UnmatchedIsland>)> {
        let unmatched = Unmatched::new(self);
        let answer = |k| progress.check().map(|()| policy.answer(self, unmatched.members(k)));
        let mut answers = (0..unmatched.count()).into_par_iter().map(answer).collect::<Result<Vec<_>>>()?;
        let pending: Vec<u32> =
            std::iter::zip(0.., &answers).filter(|(_, a)| matches!(a, Answer::Hang)).map(|(k, _)| k).collect();
        if !pending.is_empty() {
            let rows = SpanningTree::new(self, &weights, &unmatched, &pending, progress)?.hang(progress)?;
            std::iter::zip(&pending, rows).for_each(|(&k, row)| answers[k as usize] = Answer::Hung(row));
        }
        let report = |(k, answer): (usize, &Answer)| UnmatchedIsland {
            first_vertex: unmatched.members(k)[0],
            vertices: unmatched.members(k).len(),
            policy: answer.given_by(policy),
        };
        let reports = answers.iter().enumerate().map(report).collect();
        Ok((self.rows(weights, &unmatched, &answers), reports))
    }

    fn rows(&self, weights: Weights, unmatched: &Unmatched, answers: &[Answer]) -> Weights {
        let is_loose = || self.islands.of_vertex().par_iter().with_min_len(4096).any(|&island| island == NONE);
        if answers.is_empty() && !is_loose() {
            return weights;
        }
        Weights::from_rows(self.points.len(), weights.n_bones(), Row::new, |row, i, out| {
            row.clear();
            match self.islands.of_vertex()[i] {
                NONE => self.source.blend(&self.points[i], row),
                island => match unmatched.number[island as usize] {
                    NONE => {
                        let (bones, values) = weights.row(i);
                        out.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
                    }
                    k => answers[k as usize].append_row(self, i, row),
                },
            }
            out.extend(row.iter().map(|&(bone, value)| (bone, value as f32)));
        })
    }
}
