//! The factored blocks of a target, kept from one solve to the next.

use rayon::prelude::*;

use super::Source;
use super::inpaint::{Block, BlockWeights, System};
use super::problem::Problem;
use super::system::{independent_blocks, number_unknowns};
use crate::adjacency::NONE;
use crate::error::Result;
use crate::laplacian::Laplacian;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::surface::SurfacePoint;

/// Factored blocks, by first vertex.
#[derive(Debug, Default)]
pub(super) struct Blocks(Vec<Block>);

impl Blocks {
    pub(super) fn count(&self) -> usize {
        self.0.len()
    }

    /// Drops the blocks that `problem` has no use for and assembles those that it lacks.
    pub(super) fn assemble_missing(
        &mut self,
        laplacian: &Laplacian,
        problem: &Problem,
        progress: &Progress,
    ) -> Result<Vec<System>> {
        let l = problem.smoothness_length;
        let wanted = independent_blocks(laplacian, &problem.unknown, l);
        let number = number_unknowns(&wanted, problem.unknown.len());
        self.0.retain(|block| {
            let at = wanted.binary_search_by_key(&block.unknowns()[0], |unknowns| unknowns[0]);
            at.is_ok_and(|at| block.serves(&wanted[at], l))
        });
        let kept = |first| self.0.binary_search_by_key(&first, |block| block.unknowns()[0]).is_ok();
        let missing: Vec<Vec<u32>> = wanted.into_iter().filter(|unknowns| !kept(unknowns[0])).collect();
        let assemble = |unknowns| {
            progress.check()?;
            Ok(System::new(laplacian, unknowns, &number, l))
        };
        missing.into_par_iter().map(assemble).collect()
    }

    /// Factors what was missing and keeps it.
    pub(super) fn factor(&mut self, mesh: &TriMesh<'_>, missing: Vec<System>, progress: &Progress) -> Result<()> {
        let factor = |system| {
            progress.check()?;
            Block::new(mesh, system)
        };
        let fresh: Result<Vec<Block>> = missing.into_par_iter().map(factor).collect();
        self.0.extend(fresh?);
        self.0.sort_by_key(|block| block.unknowns()[0]);
        progress.report(0.7);
        progress.check()
    }

    /// Solves all blocks, given the source and each vertex' closest `points` (V) on it.
    pub(super) fn solve(&self, source: &Source, points: &[SurfacePoint], progress: &Progress) -> Result<Solved<'_>> {
        let weights = self.0.par_iter().map(|block| progress.check().and_then(|()| block.solve(source, points)));
        Ok(Solved { blocks: &self.0, weights: weights.collect::<Result<_>>()? })
    }
}

/// Raw weights of the unknowns.
pub(super) struct Solved<'b> {
    blocks: &'b [Block],
    weights: Vec<BlockWeights<'b>>,
}

impl Solved<'_> {
    /// Block and place in it of every vertex (V), [`NONE`] twice where it is no unknown.
    pub(super) fn places(&self, vertex_count: usize) -> Vec<(u32, u32)> {
        let mut places = vec![(NONE, NONE); vertex_count];
        for (b, block) in self.blocks.iter().enumerate() {
            for (k, &i) in block.unknowns().iter().enumerate() {
                places[i as usize] = (b as u32, k as u32);
            }
        }
        places
    }

    /// Bones and raw weights of unknown `k` of block `b`.
    pub(super) fn row(&self, b: u32, k: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        self.weights[b as usize].row(k as usize)
    }

    /// The smallest raw weight, 0 where nothing was solved for.
    pub(super) fn minimum(&self) -> f64 {
        let least = std::iter::zip(self.blocks, &self.weights).map(|(block, weights)| {
            let rows = (0..block.unknowns().len()).into_par_iter().with_min_len(256);
            let least = |k| weights.row(k).map(|(_, value)| value).fold(f64::INFINITY, f64::min);
            rows.map(least).reduce(|| f64::INFINITY, f64::min)
        });
        least.min_by(f64::total_cmp).unwrap_or(0.0)
    }

    pub(super) fn largest_residual(&self) -> f64 {
        self.weights.iter().map(BlockWeights::residual).fold(0.0, f64::max)
    }
}
