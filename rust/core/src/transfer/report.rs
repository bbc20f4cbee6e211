//! What a transfer says of itself.

use std::time::Instant;

use super::pipeline::Problem;
use super::{Inpainting, UnmatchedIsland};
use crate::weights::Weights;

/// Counts, islands and seconds of one transfer.
#[derive(Debug, Clone, Default)]
pub struct Report {
    /// Target vertices.
    pub vertices: usize,
    /// Vertices that took their weights from the source.
    pub matched: usize,
    /// Vertices that were solved for.
    pub inpainted: usize,
    /// Vertices that are one with an earlier vertex, and share its row.
    pub welded: usize,
    /// Vertices that neither triangle nor edge uses: they took their closest point's weights.
    pub loose: usize,
    /// Vertices that are left without any weight (skipped islands, or nothing weighted near a loose vertex).
    pub unweighted: usize,
    /// Islands of the target.
    pub islands: usize,
    /// Islands without a match and what became of them.
    pub unmatched_islands: Vec<UnmatchedIsland>,
    /// Small loose islands that were made rigid.
    pub rigid_islands: usize,
    /// Independent blocks of the system, and how many of them had to be factored.
    pub blocks: usize,
    /// See `blocks`.
    pub factored_blocks: usize,
    /// Vertices that were solved again after a stroke, if not all were: see
    /// [`Inpainting::solve_near`](super::Inpainting::solve_near).
    pub solved_near: Option<usize>,
    /// Bones with any weight in the result.
    pub bones_used: usize,
    /// Most influences of any vertex in the result.
    pub most_influences: usize,
    /// Source vertices without weights, and those whose weights did not sum to one.
    pub source_unweighted: usize,
    /// See `source_unweighted`.
    pub source_unnormalised: usize,
    /// Smallest weight before clamping.
    pub raw_minimum: f64,
    /// Largest backward error of any block's solve; with the method of confidences what counts as zero there is part of it.
    pub largest_residual: f64,
    /// Distance in force, world units.
    pub max_distance: f64,
    /// Smoothness length in force, world units.
    pub smoothness_length: f64,
    /// Stage and wall seconds, in order.
    pub seconds: Vec<(&'static str, f64)>,
}

impl Report {
    /// With what the problem and its blocks tell.
    pub(super) fn of_problem(self, prepared: &Inpainting, problem: &Problem, matched: &[bool]) -> Self {
        let fill = &prepared.target.fill;
        let (source_unweighted, source_unnormalised) = prepared.source.unweighted_and_unnormalised();
        Self {
            source_unweighted,
            source_unnormalised,
            matched: count(matched),
            inpainted: count(fill.unknown()),
            loose: count(&prepared.target.is_loose()),
            islands: fill.islands().count(),
            blocks: fill.block_count(),
            max_distance: problem.criteria.max_distance,
            smoothness_length: problem.smoothness_length,
            ..self
        }
    }

    /// With the counts that the resulting weights alone tell.
    pub(super) fn counting(self, weights: &Weights) -> Self {
        let influences = || weights.indptr().windows(2).map(|w| (w[1] - w[0]) as usize);
        let mut used = vec![false; weights.n_bones() as usize];
        weights.bones().iter().for_each(|&bone| used[bone as usize] = true);
        Self {
            vertices: weights.vertex_count(),
            unweighted: influences().filter(|&n| n == 0).count(),
            bones_used: count(&used),
            most_influences: influences().max().unwrap_or(0),
            ..self
        }
    }
}

fn count(flags: &[bool]) -> usize {
    flags.iter().filter(|&&flag| flag).count()
}

/// A stopwatch over consecutive stages.
pub(super) struct Stages {
    start: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Stages {
    pub fn start() -> Self {
        Self { start: Instant::now(), seconds: Vec::new() }
    }

    /// Books the time since the last call on `stage`.
    pub fn end(&mut self, stage: &'static str) {
        self.seconds.push((stage, self.start.elapsed().as_secs_f64()));
        self.start = Instant::now();
    }

    pub fn into_seconds(self) -> Vec<(&'static str, f64)> {
        self.seconds
    }
}
