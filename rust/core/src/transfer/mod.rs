//! Skin-weight transfer by weight inpainting (Abdrashitov et al., *Robust Skin Weights Transfer via Weight Inpainting*,
//! SIGGRAPH Asia 2023 Technical Communications, doi 10.1145/3610543.3626180).
//!
//! Match -> constraints -> fill -> smooth -> islands -> limit. Vertices near the source with agreeing normals copy its weights
//! ([`MatchMethod`]); the others are solved for by the part [`fill`](crate::fill); parts without any match follow an
//! [`IslandPolicy`]; then come optional smoothing and a limit on influences. [`Inpainting`] keeps what can be used
//! again.

mod detail;
mod islands;
mod matching;
mod near;
mod normals;
mod pipeline;
mod prepared;
mod report;
mod settings;
mod small_islands;
mod smooth;
mod source;
mod target;

pub use islands::{IslandPolicy, UnmatchedIsland};
pub use matching::{Criteria, MaskValue, MatchMethod};
pub use prepared::{Inpainting, RawWeights};
pub use report::Report;
pub use settings::{Length, Settings};
pub use small_islands::SmallIslands;
pub use source::Source;
pub use target::TargetMesh;

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
    /// Distance of each vertex to its point on the source, world units.
    pub distances: Vec<f32>,
    /// Angle between the normals there, radians, NaN where one is missing.
    pub angles: Vec<f32>,
    /// Counts, islands and seconds.
    pub report: Report,
}

/// Transfers the weights of `source` to a mesh in the source's space, once.
///
/// # Errors
/// Those of [`Inpainting::new`] and [`Inpainting::solve`].
///
/// # Example
/// A sleeve takes the weights of the arm in it:
/// ```
/// use skinwright_core::transfer::{Settings, Source, TargetMesh, transfer_weights};
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/read/mod.rs"));
/// # fn main() -> Result<(), Box<dyn AnyError>> {
/// # let (arm, arm_triangles) = mesh(data("arm.obj"))?;
/// # let arm_weights = weights(data("arm.weights"), arm.len())?;
/// # let (positions, triangles) = mesh(data("sleeve.obj"))?;
/// let source = Source::new(&arm, arm_triangles, arm_weights)?;
/// let sleeve = TargetMesh { positions, triangles, ..TargetMesh::default() };
/// let transfer = transfer_weights(&source, sleeve, None, &Settings::default())?;
/// assert_eq!(transfer.report.matched, transfer.report.vertices);
/// let (bones, values) = transfer.weights.row(0);
/// assert_eq!((bones, values), (&[0][..], &[1.0][..]));
/// # Ok(())
/// # }
/// ```
pub fn transfer_weights(
    source: &Source,
    target: TargetMesh,
    mask: Option<&[MaskValue]>,
    settings: &Settings,
) -> Result<Transfer> {
    let progress = Progress::default();
    Inpainting::new(source.clone(), target, settings, &progress)?.solve(mask, settings, &progress)
}
