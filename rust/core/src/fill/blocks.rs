//! The factored blocks of a mesh, kept from one solve to the next.

use rayon::prelude::*;

use super::block::{Block, BlockRows, Form, System};
use super::constraint::Known;
use super::rows::KnownRows;
use super::screened::{self, Given};
use super::system::{independent_blocks, number_unknowns};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::progress::Progress;

/// Factored blocks, by first vertex.
#[derive(Debug, Default)]
pub(super) struct Blocks(Vec<Block>);

impl Blocks {
    pub(super) fn as_slice(&self) -> &[Block] {
        &self.0
    }

    /// Drops the blocks that `known` has no use for and assembles those that it lacks.
    pub(super) fn assemble_missing(
        &mut self,
        laplacian: &Laplacian,
        known: &Known,
        form: Form,
        progress: &Progress,
    ) -> Result<Vec<System>> {
        let wanted = independent_blocks(laplacian, &known.unknown, form.length);
        let number = number_unknowns(&wanted, known.unknown.len());
        self.0.retain(|block| {
            let at = wanted.binary_search_by_key(&block.unknowns()[0], |unknowns| unknowns[0]);
            at.is_ok_and(|at| block.serves(&wanted[at], known, form))
        });
        let kept = |first| self.0.binary_search_by_key(&first, |block| block.unknowns()[0]).is_ok();
        let missing: Vec<Vec<u32>> = wanted.into_iter().filter(|unknowns| !kept(unknowns[0])).collect();
        let assemble = |unknowns| {
            progress.check()?;
            Ok(System::new(laplacian, known, unknowns, &number, form))
        };
        missing.into_par_iter().map(assemble).collect()
    }

    /// Factors what was missing and keeps it. Returns the unknowns of blocks that are not positive definite.
    pub(super) fn factor(
        &mut self,
        positions: &[[f32; 3]],
        missing: Vec<System>,
        progress: &Progress,
    ) -> Result<Vec<Vec<u32>>> {
        let factor = |system: System| {
            progress.check()?;
            let unknowns = system.unknowns().to_vec();
            match Block::new(positions, system, progress) {
                Ok(block) => Ok(Ok(block)),
                Err(Error::NotPositiveDefinite { .. }) => Ok(Err(unknowns)),
                Err(error) => Err(error),
            }
        };
        let outcomes: Vec<_> = missing.into_par_iter().map(factor).collect::<Result<_>>()?;
        let mut failed = Vec::new();
        for outcome in outcomes {
            match outcome {
                Ok(block) => self.0.push(block),
                Err(unknowns) => failed.push(unknowns),
            }
        }
        self.0.sort_by_key(|block| block.unknowns()[0]);
        Ok(failed)
    }

    /// Solves all blocks.
    pub(super) fn solve(&self, known: KnownRows<'_>, progress: &Progress) -> Result<Vec<BlockRows<'_>>> {
        self.0.par_iter().map(|block| progress.check().and_then(|()| block.solve(known))).collect()
    }

    /// Solves all blocks with lengths of trust, see [`screened`].
    pub(super) fn solve_screened(&self, given: Given<'_>, progress: &Progress) -> Result<Vec<BlockRows<'_>>> {
        let solve = |block| progress.check().and_then(|()| screened::solve(block, given, progress));
        self.0.par_iter().map(solve).collect()
    }
}
