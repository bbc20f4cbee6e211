//! A target prepared on a source: matching found once, factorisations kept.

use super::blocks::{Blocks, Solved};
use super::islands::Scene;
use super::matching::Closest;
use super::problem::Problem;
use super::report::{Report, Stages};
use super::smooth::push_normalised;
use super::{Criteria, MaskValue, Settings, Source, Transfer, limit, smooth};
use crate::adjacency::{Islands, NONE, Topology};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::surface::SurfacePoint;
use crate::weights::Weights;

/// A target prepared for solving again and again.
///
/// Closest points are found once. A block is factored again only when its unknowns or the smoothness length change;
/// changing smoothing, limit, policy or the source's weights factors nothing.
#[derive(Debug)]
pub struct Inpainting {
    pub(super) source: Source,
    positions: Vec<[f32; 3]>,
    /// Without repeated vertices and duplicates.
    triangles: Vec<[u32; 3]>,
    pub(super) diagonal: f64,
    pub(super) islands: Islands,
    laplacian: Laplacian,
    pub(super) closest: Closest,
    blocks: Blocks,
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

impl Inpainting {
    /// Prepares a target mesh (V positions in the source's space, T triangles).
    ///
    /// # Errors
    /// Those of [`TriMesh::new`], [`Error::Cancelled`].
    pub fn new(
        source: Source,
        positions: Vec<[f32; 3]>,
        triangles: Vec<[u32; 3]>,
        progress: &Progress,
    ) -> Result<Self> {
        let mut stages = Stages::start();
        let mesh = TriMesh::new(&positions, &triangles, "target")?;
        let diagonal = mesh.diagonal();
        let closest = Closest::new(&source, &mesh);
        stages.end("match");
        progress.report(0.3);
        progress.check()?;
        let topology = Topology::new(&triangles, positions.len());
        let laplacian = Laplacian::new(&mesh, &topology);
        stages.end("laplacian");
        progress.report(0.4);
        let Topology { triangles: clean, islands, .. } = topology;
        let triangles = if clean.len() == triangles.len() { triangles } else { clean.into_owned() };
        let preparation = stages.into_seconds();
        Ok(Self {
            source,
            diagonal,
            islands,
            laplacian,
            closest,
            positions,
            triangles,
            blocks: Blocks::default(),
            preparation,
        })
    }

    /// Closest source point of each vertex (V).
    pub fn points(&self) -> &[SurfacePoint] {
        &self.closest.points
    }

    /// Angle between the normals of each vertex and of its closest point (V), radians, NaN where a normal is missing.
    pub fn angles(&self) -> &[f32] {
        &self.closest.angles
    }

    /// The target's islands.
    pub fn islands(&self) -> &Islands {
        &self.islands
    }

    /// Gives the source other weights (V rows); nothing geometric is computed anew.
    ///
    /// # Errors
    /// Those of [`Source::with_weights`].
    pub fn set_source_weights(&mut self, weights: Weights) -> Result<()> {
        self.source = self.source.with_weights(weights)?;
        self.closest.refresh_weighted(&self.source);
        Ok(())
    }

    /// Which vertices match (V), given a `mask` (V) and the distances and angles of `settings`.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`], [`Error::LengthMismatch`].
    pub fn matched(&self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<Vec<bool>> {
        settings.check()?;
        self.check_mask(mask)?;
        Ok(self.closest.matched(&self.criteria(settings), mask))
    }

    /// Transfers the source's weights, given a `mask` (V).
    ///
    /// # Errors
    /// [`Error::NothingMatched`], [`Error::NotPositiveDefinite`], [`Error::InvalidParameter`],
    /// [`Error::LengthMismatch`], [`Error::Cancelled`]. A failed solve leaves the kept blocks usable.
    pub fn solve(&mut self, mask: Option<&[MaskValue]>, settings: &Settings, progress: &Progress) -> Result<Transfer> {
        let mut stages = Stages::start();
        let problem = Problem::new(self, mask, settings)?;
        let missing = self.blocks.assemble_missing(&self.laplacian, &problem, progress)?;
        let factored_blocks = missing.len();
        stages.end("assemble");
        let mesh = TriMesh::new(&self.positions, &self.triangles, "target")?;
        self.blocks.factor(&mesh, missing, progress)?;
        stages.end("factor");
        let solved = self.blocks.solve(&self.source, &self.closest.points, progress)?;
        stages.end("solve");
        let weights = self.gather(&problem, &solved);
        stages.end("gather");
        let weights = self.smooth(weights, &problem, settings);
        stages.end("smooth");
        progress.check()?;
        let (weights, unmatched_islands) = self.scene(&problem).fill(weights, settings.island_policy);
        let weights =
            if settings.max_influences > 0 { limit::limit(weights, settings.max_influences) } else { weights };
        stages.end("islands and limit");
        let (source_unweighted, source_unnormalised) = self.source.unweighted_and_unnormalised();
        let report = Report {
            unmatched_islands,
            factored_blocks,
            source_unweighted,
            source_unnormalised,
            matched: count(&problem.matched),
            inpainted: count(&problem.unknown),
            loose: self.islands.of_vertex().iter().filter(|&&island| island == NONE).count(),
            islands: self.islands.count(),
            blocks: self.blocks.count(),
            max_distance: problem.criteria.max_distance,
            smoothness_length: problem.smoothness_length,
            raw_minimum: solved.minimum(),
            largest_residual: solved.largest_residual(),
            seconds: self.preparation.iter().copied().chain(stages.into_seconds()).collect(),
            ..Report::of_weights(&weights)
        };
        progress.report(1.0);
        Ok(Transfer { weights, matched: problem.matched, report })
    }

    /// The solutions of the blocks as they are, for checks against other solvers.
    ///
    /// # Errors
    /// Those of [`Inpainting::solve`].
    pub fn raw_weights(&mut self, mask: Option<&[MaskValue]>, settings: &Settings) -> Result<RawWeights> {
        let problem = Problem::new(self, mask, settings)?;
        let progress = Progress::default();
        let missing = self.blocks.assemble_missing(&self.laplacian, &problem, &progress)?;
        let mesh = TriMesh::new(&self.positions, &self.triangles, "target")?;
        self.blocks.factor(&mesh, missing, &progress)?;
        let solved = self.blocks.solve(&self.source, &self.closest.points, &progress)?;
        let places = solved.places(self.positions.len());
        let vertices: Vec<u32> = (0..places.len() as u32).filter(|&i| problem.unknown[i as usize]).collect();
        let n_bones = self.source.n_bones() as usize;
        let mut values = vec![0.0; vertices.len() * n_bones];
        for (&i, values) in std::iter::zip(&vertices, values.chunks_exact_mut(n_bones.max(1))) {
            let (b, k) = places[i as usize];
            solved.row(b, k).for_each(|(bone, value)| values[bone as usize] = value);
        }
        Ok(RawWeights { vertices, values })
    }

    pub(super) fn criteria(&self, settings: &Settings) -> Criteria {
        Criteria {
            max_distance: settings.max_distance.of(self.diagonal),
            max_normal_angle: settings.max_normal_angle,
            match_flipped_normals: settings.match_flipped_normals,
        }
    }

    fn check_mask(&self, mask: Option<&[MaskValue]>) -> Result<()> {
        let expected = self.positions.len();
        match mask.map(<[MaskValue]>::len) {
            Some(found) if found != expected => Err(Error::LengthMismatch { what: "mask", found, expected }),
            _ => Ok(()),
        }
    }

    /// Copies matched rows, clamps and normalises solved ones; rows of islands without a match stay empty.
    fn gather(&self, problem: &Problem, solved: &Solved<'_>) -> Weights {
        let places = solved.places(self.positions.len());
        Weights::from_rows(self.positions.len(), self.source.n_bones(), Vec::new, |row, i, out| {
            row.clear();
            let (b, k) = places[i];
            if b != NONE {
                row.extend(solved.row(b, k));
            } else if problem.matched[i] {
                self.source.blend(&self.closest.points[i], row);
            }
            push_normalised(row, out);
        })
    }

    fn smooth(&self, weights: Weights, problem: &Problem, settings: &Settings) -> Weights {
        if settings.smoothing_iterations == 0 || settings.smoothing_factor == 0.0 {
            return weights;
        }
        let mesh = TriMesh::new(&self.positions, &self.triangles, "target").expect("checked when prepared");
        let reach = problem.criteria.max_distance;
        let region = smooth::region(&mesh, &self.laplacian, &problem.unknown, reach);
        smooth::smooth(weights, &self.laplacian, &region, settings.smoothing_iterations, settings.smoothing_factor)
    }

    fn scene<'a>(&'a self, problem: &'a Problem) -> Scene<'a> {
        Scene {
            source: &self.source,
            mesh: TriMesh::new(&self.positions, &self.triangles, "target").expect("checked when prepared"),
            triangles: &self.triangles,
            islands: &self.islands,
            points: &self.closest.points,
            has_match: &problem.has_match,
            max_distance: problem.criteria.max_distance,
        }
    }
}

fn count(flags: &[bool]) -> usize {
    flags.iter().filter(|&&flag| flag).count()
}
