//! A target prepared on a source: matching found once, factorisations kept.

use super::matching::Matches;
use super::near::{self, Base};
use super::pipeline::{self, Problem};
use super::report::Stages;
use super::target::{Target, TargetMesh};
use super::{Criteria, MaskValue, Settings, Source, Transfer};
use crate::error::Result;
use crate::fill::Row;
use crate::progress::Progress;
use crate::weights::Weights;

/// A target prepared for solving again and again.
///
/// It is welded, and points on the source are found, once for the settings that this depends on; a solve with others
/// does it again. A block is factored again only when its unknowns, their confidences or the smoothness length change;
/// changing smoothing, limit, policy or the source's weights factors nothing.
#[derive(Debug)]
pub struct Inpainting {
    pub(super) source: Source,
    pub(super) target: Target,
    pub(super) matches: Matches,
    pub(super) preparation: Vec<(&'static str, f64)>,
    /// Whether solves are kept for [`Self::solve_near`], and the last one.
    pub(super) keeps_solves: bool,
    pub(super) base: Option<Base>,
}

/// Raw solutions, before clamping and normalising, for checks against other solvers.
#[derive(Debug)]
pub struct RawWeights {
    /// The unknowns, ascending (U).
    pub vertices: Vec<u32>,
    /// Weights, (U, bones) row-major.
    pub values: Vec<f64>,
}

impl Inpainting {
    /// Prepares a target in the source's space for the method, thresholds and weld tolerance of `settings`.
    ///
    /// # Errors
    /// Those of [`TriMesh::new`](crate::TriMesh::new) and [`Settings::check`], [`Error::Cancelled`](crate::Error::Cancelled).
    pub fn new(source: Source, target: TargetMesh, settings: &Settings, progress: &Progress) -> Result<Self> {
        settings.check()?;
        let mut stages = Stages::start();
        let target = Target::new(target, settings.weld_tolerance)?;
        stages.end("laplacian");
        progress.report(0.1);
        progress.check()?;
        let criteria = Criteria::new(settings, &source, &target);
        let matches = Matches::find(settings.method, &source, target.surface(), &criteria);
        stages.end("match");
        progress.report(0.4);
        progress.check()?;
        let preparation = stages.into_seconds();
        Ok(Self { source, target, matches, preparation, keeps_solves: false, base: None })
    }

    /// Distance of each vertex (V) to its point on the source, world units.
    pub fn distances(&self) -> Vec<f32> {
        self.target.expand(self.matches.distances())
    }

    /// Angle between the normals of each vertex and of its point (V), radians, NaN where a normal is missing.
    pub fn angles(&self) -> Vec<f32> {
        self.target.expand(self.matches.angles().to_vec())
    }

    /// Island of each vertex (V), [`NONE`](crate::adjacency::NONE) for one that has neither triangle nor edge.
    pub fn island_of_vertex(&self) -> Vec<u32> {
        self.target.expand(self.target.fill.islands().of_vertex().to_vec())
    }

    /// Gives the source other weights (V rows); nothing geometric is computed again.
    ///
    /// # Errors
    /// Those of [`Source::with_weights`].
    pub fn set_source_weights(&mut self, weights: Weights) -> Result<()> {
        self.source = self.source.with_weights(weights)?;
        self.base = None;
        self.matches.refresh_weighted(&self.source);
        Ok(())
    }

    /// Which vertices match (V), given a `mask` (V) and `settings`: those whose confidence is at least a half.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`](crate::Error::InvalidParameter), [`Error::LengthMismatch`](crate::Error::LengthMismatch).
    pub fn matched(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Vec<bool>> {
        Ok(pipeline::trusted(&self.confidence(mask, settings)?))
    }

    /// How far the row that each vertex takes from the source is trusted, 0 to 1 (V): all or nothing with
    /// [`MatchMethod::ClosestPoint`](super::MatchMethod::ClosestPoint), and where the mask decides.
    ///
    /// # Errors
    /// Those of [`Inpainting::matched`].
    pub fn confidence(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Vec<f32>> {
        let mask = self.prepare_for(mask, settings)?;
        let constraints = self.matches.constraints(&pipeline::terms(self, settings), mask.as_deref());
        Ok(self.target.expand(self.matches.confidence(&constraints, settings.softness, mask.as_deref())))
    }

    /// Transfers the source's weights, given a `mask` (V). Vertices that are one get the same bits.
    ///
    /// # Errors
    /// [`Error::NothingMatched`](crate::Error::NothingMatched),
    /// [`Error::NotPositiveDefinite`](crate::Error::NotPositiveDefinite),
    /// [`Error::InvalidParameter`](crate::Error::InvalidParameter), [`Error::LengthMismatch`](crate::Error::LengthMismatch),
    /// [`Error::Cancelled`](crate::Error::Cancelled). A failed solve leaves the kept blocks usable.
    pub fn solve(&mut self, mask: Option<&[MaskValue]>, settings: &Settings, progress: &Progress) -> Result<Transfer> {
        let mask = self.prepare_for(mask, settings)?;
        let transfer = pipeline::solve(self, mask.as_deref(), settings, progress)?;
        progress.report(1.0);
        Ok(self.target.expand_transfer(transfer))
    }

    /// The same for a stroke of the mask, sooner: only the neighbourhood of what has changed since the last [`Self::solve`] is
    /// solved again, and [`Report::solved_near`](super::Report::solved_near) says so. Other rows are as they were, which they
    /// would not be quite. A solve that nothing can be kept from, a change of settings, of many vertices or of a small mesh is
    /// solved as a whole.
    ///
    /// # Errors
    /// Those of [`Self::solve`].
    pub fn solve_near(
        &mut self,
        mask: Option<&[MaskValue]>,
        settings: &Settings,
        progress: &Progress,
    ) -> Result<Transfer> {
        let of_target = self.prepare_for(mask, settings)?;
        self.keeps_solves = true;
        match near::solve(self, of_target.as_deref(), settings, progress)? {
            None => self.solve(mask, settings, progress),
            Some(transfer) => {
                progress.report(1.0);
                Ok(self.target.expand_transfer(transfer))
            }
        }
    }

    /// Whether [`Self::solve_near`] has a solve of the whole to start from.
    pub fn has_base(&self) -> bool {
        self.base.is_some()
    }

    /// The solutions of the blocks as they are, for checks against other solvers.
    ///
    /// # Errors
    /// Those of [`Inpainting::solve`].
    pub fn raw_weights(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<RawWeights> {
        let mask = self.prepare_for(mask, settings)?;
        let progress = Progress::default();
        let problem = Problem::new(self, mask.as_deref(), settings)?;
        let assembled = problem.assemble(self, &progress)?;
        self.target.fill.factor(assembled, &progress)?;
        let class_of = self.target.expand((0..self.target.fill.unknown().len() as u32).collect());
        let is_unknown = |&i: &u32| self.target.fill.unknown()[class_of[i as usize] as usize];
        let vertices: Vec<u32> = (0..class_of.len() as u32).filter(is_unknown).collect();
        let n_bones = self.source.n_bones() as usize;
        let mut values = vec![0.0; vertices.len() * n_bones];
        pipeline::filled(self, &problem, mask.as_deref(), false, &progress, |filled| {
            let mut row = Row::new();
            for (&i, values) in std::iter::zip(&vertices, values.chunks_exact_mut(n_bones.max(1))) {
                row.clear();
                filled.append_row(class_of[i as usize] as usize, &mut row);
                row.iter().for_each(|&(bone, value)| values[bone as usize] = value);
            }
        })?;
        Ok(RawWeights { vertices, values })
    }

    /// Does again what other settings ask for; the mask of the mesh that is solved on.
    fn prepare_for(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Option<Vec<MaskValue>>> {
        settings.check()?;
        let is_another = self.target.weld_again(settings.weld_tolerance)?;
        let criteria = Criteria::new(settings, &self.source, &self.target);
        if is_another {
            self.base = None;
        }
        if is_another || self.matches.differ(settings.method, settings.average_ties) {
            self.matches = Matches::find(settings.method, &self.source, self.target.surface(), &criteria);
        } else {
            self.matches.refresh(&self.source, self.target.surface(), &criteria);
        }
        self.target.mask(mask)
    }
}
