//! A target prepared on a source: matching found once, factorisations kept.

use glam::Vec3;

use super::detail::Detail;
use super::islands::Scene;
use super::matching::{Matches, TargetSurface, Terms};
use super::problem::Problem;
use super::report::{Report, Stages};
use super::smooth::push_normalised;
use super::{Criteria, MaskValue, MatchMethod, Settings, Source, Transfer, limit, small_islands, smooth};
use crate::adjacency::{Islands, NONE};
use crate::error::{Error, Result};
use crate::fill::{Constraint, Fill, Filled, Row};
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::surface::SurfacePoint;
use crate::weights::Weights;

/// A target prepared for solving again and again.
///
/// Points on the source are found once for each [`MatchMethod`]. A block is factored again only when its unknowns, their
/// confidences or the smoothness length change; changing smoothing, limit, policy or the source's weights factors nothing.
#[derive(Debug)]
pub struct Inpainting {
    pub(super) source: Source,
    fill: Fill,
    normals: Vec<Vec3>,
    pub(super) diagonal: f64,
    pub(super) matches: Matches,
    preparation: Vec<(&'static str, f64)>,
}

/// Raw solutions, before clamping and normalising, for checks against other solvers.
#[derive(Debug)]
pub struct RawWeights {
    /// The unknowns, ascending (U).
    pub vertices: Vec<u32>,
    /// Weights, (U, bones) row-major.
    pub values: Vec<f64>,
}

/// What a solve leaves behind.
struct Solved {
    weights: Weights,
    inpainted: usize,
    blocks: usize,
    minimum: f64,
    residual: f64,
}

impl Inpainting {
    /// Prepares a target mesh (V positions in the source's space, T triangles) for `method`; a solve with another one
    /// finds its points anew.
    ///
    /// # Errors
    /// Those of [`TriMesh::new`], [`Error::Cancelled`].
    pub fn new(
        source: Source,
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        method: MatchMethod,
        progress: &Progress,
    ) -> Result<Self> {
        let mut stages = Stages::start();
        let mesh = TriMesh::new(&positions, &triangles, "target")?;
        let (diagonal, normals) = (mesh.diagonal(), mesh.vertex_normals());
        let matches = Matches::find(method, &source, TargetSurface { positions: &positions, normals: &normals });
        stages.end("match");
        progress.report(0.3);
        progress.check()?;
        let fill = Fill::new(positions, triangles, None)?;
        stages.end("laplacian");
        progress.report(0.4);
        Ok(Self { source, fill, normals, diagonal, matches, preparation: stages.into_seconds() })
    }

    /// The point of each vertex (V) on the source that distance, angle and policies refer to.
    pub fn points(&self) -> &[SurfacePoint] {
        self.matches.points()
    }

    /// Angle between the normals of each vertex and of its point (V), radians, NaN where a normal is missing.
    pub fn angles(&self) -> &[f32] {
        self.matches.angles()
    }

    /// The target's islands.
    pub fn islands(&self) -> &Islands {
        self.fill.islands()
    }

    /// Gives the source other weights (V rows); nothing geometric is computed anew.
    ///
    /// # Errors
    /// Those of [`Source::with_weights`].
    pub fn set_source_weights(&mut self, weights: Weights) -> Result<()> {
        self.source = self.source.with_weights(weights)?;
        self.matches.refresh_weighted(&self.source);
        Ok(())
    }

    /// Which vertices match (V), given a `mask` (V) and `settings`: those whose confidence is at least a half.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`], [`Error::LengthMismatch`].
    pub fn matched(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Vec<bool>> {
        Ok(trusted(&self.confidence(mask, settings)?))
    }

    /// How far the row that each vertex takes from the source is trusted, 0 to 1 (V): all or nothing with
    /// [`MatchMethod::ClosestPoint`], and where the mask decides.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`], [`Error::LengthMismatch`].
    pub fn confidence(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Vec<f32>> {
        self.prepare_for(settings.method);
        let constraints = self.constraints(mask, settings)?;
        Ok(self.matches.confidence(&constraints, settings.softness, mask))
    }

    /// Transfers the source's weights, given a `mask` (V).
    ///
    /// # Errors
    /// [`Error::NothingMatched`], [`Error::NotPositiveDefinite`], [`Error::InvalidParameter`],
    /// [`Error::LengthMismatch`], [`Error::Cancelled`]. A failed solve leaves the kept blocks usable.
    pub fn solve(&mut self, mask: Option<&[MaskValue]>, settings: &Settings, progress: &Progress) -> Result<Transfer> {
        let mut stages = Stages::start();
        self.prepare_for(settings.method);
        let problem = Problem::new(self, mask, settings)?;
        let assembled = self.fill.assemble(problem.constraints.clone(), problem.smoothness_length, progress)?;
        let factored_blocks = assembled.missing_blocks();
        stages.end("assemble");
        self.fill.factor(assembled, progress)?;
        progress.report(0.7);
        progress.check()?;
        stages.end("factor");
        let solved = self.solved(&problem, mask, progress, |filled| Solved {
            weights: self.gather(filled),
            inpainted: count(self.fill.unknown()),
            blocks: self.fill.block_count(),
            minimum: filled.minimum(),
            residual: filled.largest_residual(),
        })?;
        stages.end("solve");
        let weights = self.inpaint_masked(solved.weights, &problem, mask, settings, progress)?;
        stages.end("inpaint");
        let weights = self.smooth(weights, &problem, settings);
        stages.end("smooth");
        progress.check()?;
        let (weights, rigid_islands) = self.stiffen(weights, settings);
        let (weights, unmatched_islands) = self.scene(&problem).fill(weights, settings.island_policy);
        let weights =
            if settings.max_influences > 0 { limit::limit(weights, settings.max_influences) } else { weights };
        stages.end("islands and limit");
        let confidence = self.matches.confidence(&problem.constraints, settings.softness, mask);
        let matched = trusted(&confidence);
        let (source_unweighted, source_unnormalised) = self.source.unweighted_and_unnormalised();
        let report = Report {
            unmatched_islands,
            rigid_islands,
            factored_blocks,
            source_unweighted,
            source_unnormalised,
            matched: count(&matched),
            inpainted: solved.inpainted,
            loose: self.islands().of_vertex().iter().filter(|&&island| island == NONE).count(),
            islands: self.islands().count(),
            blocks: solved.blocks,
            max_distance: problem.criteria.max_distance,
            smoothness_length: problem.smoothness_length,
            raw_minimum: solved.minimum,
            largest_residual: solved.residual,
            seconds: self.preparation.iter().copied().chain(stages.into_seconds()).collect(),
            ..Report::of_weights(&weights)
        };
        progress.report(1.0);
        Ok(Transfer { weights, matched, confidence, report })
    }

    /// The solutions of the blocks as they are, for checks against other solvers.
    ///
    /// # Errors
    /// Those of [`Inpainting::solve`].
    pub fn raw_weights(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<RawWeights> {
        self.prepare_for(settings.method);
        let progress = Progress::default();
        let problem = Problem::new(self, mask, settings)?;
        let assembled = self.fill.assemble(problem.constraints.clone(), problem.smoothness_length, &progress)?;
        self.fill.factor(assembled, &progress)?;
        let unknown = self.fill.unknown();
        let vertices: Vec<u32> = (0..unknown.len() as u32).filter(|&i| unknown[i as usize]).collect();
        let n_bones = self.source.n_bones() as usize;
        let mut values = vec![0.0; vertices.len() * n_bones];
        self.solved(&problem, mask, &progress, |filled| {
            let mut row = Row::new();
            for (&i, values) in std::iter::zip(&vertices, values.chunks_exact_mut(n_bones.max(1))) {
                row.clear();
                filled.append_row(i as usize, &mut row);
                row.iter().for_each(|&(bone, value)| values[bone as usize] = value);
            }
        })?;
        Ok(RawWeights { vertices, values })
    }

    /// Solves the problem that is factored and hands the rows to `take`. Soft rows are solved for twice with the same factor,
    /// the second time pulled towards the first answer: once would leave kinks.
    fn solved<T>(
        &self,
        problem: &Problem,
        mask: Option<&[MaskValue]>,
        progress: &Progress,
        take: impl FnOnce(&Filled<'_>) -> T,
    ) -> Result<T> {
        let own = |i: u32, row: &mut Row| self.matches.append_row(&self.source, mask, i, row);
        if self.matches.method() == MatchMethod::ClosestPoint {
            return Ok(take(&self.fill.solve(&own, progress)?));
        }
        let detail = Detail::new(&self.source, &self.matches, &self.fill, &problem.constraints, own);
        let first = |i: u32, row: &mut Row| {
            own(i, row);
            detail.add_to(i, row);
        };
        let smoothed = self.fill.solve(&first, progress)?;
        let second = |i: u32, row: &mut Row| {
            smoothed.append_row(i as usize, row);
            detail.add_to(i, row);
        };
        Ok(take(&self.fill.solve(&second, progress)?))
    }

    /// Where the mask says so, soft rows are replaced by those that the paper's energy finds between the others.
    fn inpaint_masked(
        &mut self,
        weights: Weights,
        problem: &Problem,
        mask: Option<&[MaskValue]>,
        settings: &Settings,
        progress: &Progress,
    ) -> Result<Weights> {
        let Some(mask) = mask.filter(|mask| mask.contains(&MaskValue::Inpaint)) else { return Ok(weights) };
        if settings.method == MatchMethod::ClosestPoint {
            return Ok(weights);
        }
        let constraint = |(i, known): (usize, &Constraint)| match known {
            _ if mask[i] == MaskValue::Inpaint => Constraint::Free,
            Constraint::Free => Constraint::Free,
            Constraint::Fixed | Constraint::Soft(_) => Constraint::Fixed,
        };
        let constraints = problem.constraints.iter().enumerate().map(constraint).collect();
        let length = settings.smoothness_length.of(self.source.diagonal());
        let assembled = self.fill.assemble(constraints, length, progress)?;
        self.fill.factor(assembled, progress)?;
        let given = |i: u32, row: &mut Row| {
            let (bones, values) = weights.row(i as usize);
            row.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, f64::from(value))));
        };
        let filled = self.fill.solve(&given, progress)?;
        Ok(self.gather(&filled))
    }

    /// Finds the points of another method, if it is another.
    fn prepare_for(&mut self, method: MatchMethod) {
        if self.matches.method() != method {
            let target = TargetSurface { positions: self.fill.mesh().positions(), normals: &self.normals };
            self.matches = Matches::find(method, &self.source, target);
        }
    }

    pub(super) fn constraints(&self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Vec<Constraint>> {
        settings.check()?;
        self.check_mask(mask)?;
        let terms = Terms { criteria: self.criteria(settings), softness: settings.softness, fill: &self.fill };
        Ok(self.matches.constraints(&terms, mask))
    }

    /// l of the system in world units: soft rows need none, for they are solved for twice.
    pub(super) fn smoothness_length(&self, settings: &Settings) -> f64 {
        match settings.method {
            MatchMethod::ClosestPoint => settings.smoothness_length.of(self.source.diagonal()),
            MatchMethod::Confidence => 0.0,
        }
    }

    pub(super) fn criteria(&self, settings: &Settings) -> Criteria {
        Criteria {
            max_distance: settings.max_distance.of(self.diagonal),
            max_normal_angle: settings.max_normal_angle,
            match_flipped_normals: settings.match_flipped_normals,
        }
    }

    fn check_mask(&self, mask: Option<&[MaskValue]>) -> Result<()> {
        let expected = self.normals.len();
        match mask.map(<[MaskValue]>::len) {
            Some(found) if found != expected => Err(Error::LengthMismatch { what: "mask", found, expected }),
            _ => Ok(()),
        }
    }

    /// Clamps and normalises the rows; those of islands without a match stay empty.
    fn gather(&self, filled: &Filled<'_>) -> Weights {
        Weights::from_rows(self.normals.len(), self.source.n_bones(), Vec::new, |row, i, out| {
            row.clear();
            filled.append_row(i, row);
            push_normalised(row, out);
        })
    }

    fn smooth(&self, weights: Weights, problem: &Problem, settings: &Settings) -> Weights {
        if settings.smoothing_iterations == 0 || settings.smoothing_factor == 0.0 {
            return weights;
        }
        let (mesh, laplacian) = (self.fill.mesh(), self.fill.laplacian());
        let region = smooth::region(&mesh, laplacian, self.fill.unknown(), problem.criteria.max_distance);
        smooth::smooth(weights, laplacian, &region, settings.smoothing_iterations, settings.smoothing_factor)
    }

    fn stiffen(&self, weights: Weights, settings: &Settings) -> (Weights, usize) {
        if !settings.stiffens() {
            return (weights, 0);
        }
        let gaps: Vec<f64> = self.matches.points().iter().map(|point| point.distance).collect();
        small_islands::stiffen(weights, &self.fill, &gaps, self.source.size())
    }

    fn scene<'a>(&'a self, problem: &'a Problem) -> Scene<'a> {
        Scene {
            source: &self.source,
            mesh: self.fill.mesh(),
            islands: self.islands(),
            points: self.matches.points(),
            has_match: &problem.has_match,
            max_distance: problem.criteria.max_distance,
        }
    }
}

fn trusted(confidence: &[f32]) -> Vec<bool> {
    confidence.iter().map(|&confidence| confidence >= 0.5).collect()
}

fn count(flags: &[bool]) -> usize {
    flags.iter().filter(|&&flag| flag).count()
}
