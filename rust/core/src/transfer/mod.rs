//! Skin-weight transfer by weight inpainting (Abdrashitov et al., *Robust Skin Weights Transfer via Weight Inpainting*,
//! SIGGRAPH Asia 2023 Technical Communications, doi 10.1145/3610543.3626180).
//!
//! Match -> constraints -> fill -> smooth -> islands -> limit. Vertices near the source with agreeing normals copy its weights
//! ([`matching`]); the others are solved for by the part [`fill`](crate::fill); parts without any match follow an
//! [`IslandPolicy`]; then come optional [`smooth`]ing and a [`limit`] on influences. [`Inpainting`] keeps what can be used
//! again.

mod detail;
mod islands;
pub mod limit;
pub mod matching;
mod prepared;
mod problem;
mod report;
mod settings;
mod small_islands;
pub mod smooth;
mod source;

pub use islands::{IslandPolicy, UnmatchedIsland};
pub use matching::{Criteria, MaskValue, MatchMethod};
pub use prepared::{Inpainting, RawWeights};
pub use report::Report;
pub use settings::{Length, Settings};
pub use small_islands::SmallIslands;
pub use source::Source;

use crate::error::Result;
use crate::progress::Progress;
use crate::weights::Weights;

/// What a transfer returns; every list has one entry per target vertex.
#[derive(Debug)]
pub struct Transfer {
    /// The new weights: rows sum to 1, bones ascending. Rows of skipped islands are empty.
    pub weights: Weights,
    /// Which vertices took their weights from the source: those that trust its row by a half or more.
    pub matched: Vec<bool>,
    /// How far the row from the source was trusted, 0 to 1.
    pub confidence: Vec<f32>,
    /// Counts, islands and seconds.
    pub report: Report,
}

/// Transfers the weights of `source` to a mesh (V positions in the source's space, T triangles), once.
///
/// # Errors
/// Those of [`Inpainting::new`] and [`Inpainting::solve`].
pub fn transfer_weights(
    source: &Source,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    mask: Option<&[MaskValue]>,
    settings: &Settings,
) -> Result<(Inpainting, Transfer)> {
    settings.check()?;
    let progress = Progress::default();
    let mut inpainting = Inpainting::new(source.clone(), positions, triangles, settings.method, &progress)?;
    let transfer = inpainting.solve(mask, settings, &progress)?;
    Ok((inpainting, transfer))
}
