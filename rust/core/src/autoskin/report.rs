//! What is to be said about automatic weights.

use std::time::Instant;

use crate::weights::Weights;

/// Counts, warnings and times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Number of vertices.
    pub vertices: usize,
    /// Of them at different positions: coincident ones act as one.
    pub distinct: usize,
    /// Vertices without an influence: none, whatever the mesh.
    pub unweighted: usize,
    /// Bones with an influence.
    pub bones_used: usize,
    /// Bones no part of which lies inside of the mesh; they reach it from the nearest point inside.
    pub bones_outside: Vec<u32>,
    /// Most influences per vertex.
    pub most_influences: usize,
    /// Cells inside of the mesh, and their size in world units; 0 where none were needed.
    pub cells: usize,
    /// Edge of a cell, world units.
    pub cell_size: f64,
    /// Backward error of the solve.
    pub residual: f64,
    /// Seconds per stage.
    pub seconds: Vec<(&'static str, f64)>,
}

impl Report {
    pub(super) fn count(&mut self, weights: &Weights) {
        let influences = || weights.indptr().windows(2).map(|w| (w[1] - w[0]) as usize);
        self.unweighted = influences().filter(|&n| n == 0).count();
        self.most_influences = influences().max().unwrap_or(0);
        let mut used = vec![false; weights.n_bones() as usize];
        weights.bones().iter().for_each(|&bone| used[bone as usize] = true);
        self.bones_used = used.into_iter().filter(|&used| used).count();
    }
}

/// Measures stages.
pub(super) struct Clock(Instant);

impl Default for Clock {
    fn default() -> Self {
        Self(Instant::now())
    }
}

impl Clock {
    /// Ends a stage and begins the next.
    pub(super) fn lap(&mut self, stage: &'static str, report: &mut Report) {
        report.seconds.push((stage, self.0.elapsed().as_secs_f64()));
        self.0 = Instant::now();
    }
}
