//! A target prepared on a source: matching found once, factorisations kept.

use rayon::prelude::*;

use super::inpaint::{Block, BlockWeights};
use super::islands::Scene;
use super::matching::Closest;
use super::problem::Problem;
use super::report::{Report, Stages};
use super::smooth::push_normalised;
use super::system::{independent_blocks, number_unknowns};
use super::{Criteria, MaskValue, Settings, Source, Transfer, limit, smooth};
use crate::adjacency::{Islands, NONE, clean_triangles};
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
    blocks: Vec<Block>,
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
        let (clean, around) = clean_triangles(&triangles, positions.len());
        let islands = Islands::new(&clean, positions.len());
        let laplacian = Laplacian::new(&mesh, &clean, &around, &islands);
        stages.end("laplacian");
        progress.report(0.4);
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
            blocks: Vec::new(),
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
        let factored_blocks = self.factor(&problem, progress)?;
        stages.end("factor");
        let solutions = self.solve_blocks(progress)?;
        let weights = self.gather(&problem, &solutions);
        stages.end("solve");
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
            blocks: self.blocks.len(),
            max_distance: problem.criteria.max_distance,
            smoothness_length: problem.smoothness_length,
            raw_minimum: raw_minimum(&solutions),
            largest_residual: solutions.iter().map(|s| s.residual).fold(0.0, f64::max),
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
        self.factor(&problem, &progress)?;
        let solutions = self.solve_blocks(&progress)?;
        let vertices: Vec<u32> = (0..problem.unknown.len() as u32).filter(|&i| problem.unknown[i as usize]).collect();
        let n_bones = self.source.n_bones() as usize;
        let mut values = vec![0.0; vertices.len() * n_bones];
        for (block, solution) in std::iter::zip(&self.blocks, &solutions) {
            for (row, i) in std::iter::zip(solution.values.chunks_exact(solution.bones.len()), block.unknowns()) {
                let at = vertices.binary_search(i).expect("every unknown is listed") * n_bones;
                for (&bone, &value) in std::iter::zip(&solution.bones, row) {
                    values[at + bone as usize] = value;
                }
            }
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

    /// Brings the kept blocks in line with `problem`; returns how many had to be factored.
    fn factor(&mut self, problem: &Problem, progress: &Progress) -> Result<usize> {
        let l = problem.smoothness_length;
        let wanted = independent_blocks(&self.laplacian, &problem.unknown, l);
        let number = number_unknowns(&wanted, self.positions.len());
        let mut kept = std::mem::take(&mut self.blocks);
        kept.retain(|block| {
            let at = wanted.binary_search_by_key(&block.unknowns()[0], |unknowns| unknowns[0]);
            at.is_ok_and(|at| block.serves(&wanted[at], l))
        });
        let missing =
            |unknowns: &Vec<u32>| kept.binary_search_by_key(&unknowns[0], |block| block.unknowns()[0]).is_err();
        let missing: Vec<Vec<u32>> = wanted.into_iter().filter(missing).collect();
        let mesh = TriMesh::new(&self.positions, &self.triangles, "target")?;
        let total = missing.len();
        let factor = |unknowns| {
            progress.check()?;
            Block::new(&mesh, &self.laplacian, unknowns, &number, l)
        };
        let fresh: Result<Vec<Block>> = missing.into_par_iter().map(factor).collect();
        self.blocks = kept;
        self.blocks.extend(fresh?);
        self.blocks.sort_by_key(|block| block.unknowns()[0]);
        progress.report(0.7);
        progress.check()?;
        Ok(total)
    }

    fn solve_blocks(&self, progress: &Progress) -> Result<Vec<BlockWeights>> {
        let solve = |block: &Block| {
            progress.check()?;
            block.solve(&self.source, &self.closest.points)
        };
        self.blocks.par_iter().map(solve).collect()
    }

    /// Copies matched rows, clamps and normalises solved ones; rows of islands without a match stay empty.
    fn gather(&self, problem: &Problem, solutions: &[BlockWeights]) -> Weights {
        let mut block_of = vec![(NONE, NONE); self.positions.len()];
        for (b, block) in self.blocks.iter().enumerate() {
            for (k, &i) in block.unknowns().iter().enumerate() {
                block_of[i as usize] = (b as u32, k as u32);
            }
        }
        Weights::from_rows(self.positions.len(), self.source.n_bones(), Vec::new, |row, i, out| {
            row.clear();
            let (b, k) = block_of[i];
            if b != NONE {
                let BlockWeights { bones, values, .. } = &solutions[b as usize];
                let values = &values[k as usize * bones.len()..][..bones.len()];
                row.extend(std::iter::zip(bones, values).map(|(&bone, &value)| (bone, value)));
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

fn raw_minimum(solutions: &[BlockWeights]) -> f64 {
    let minima = solutions.par_iter().map(|s| s.values.iter().copied().fold(f64::INFINITY, f64::min));
    let minimum = minima.reduce(|| f64::INFINITY, f64::min);
    if minimum.is_finite() { minimum } else { 0.0 }
}
