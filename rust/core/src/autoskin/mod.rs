//! Automatic weights: a first set of weights for a mesh that has a skeleton and nothing painted.

mod candidates;
mod heat;
mod inverse_distance;
mod report;
mod rows;
mod skeleton;

use crate::error::{Error, Result};
use crate::limit::limit;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::weights::Weights;
use crate::welded::Welded;

pub use report::Report;
pub use skeleton::Skeleton;

use candidates::Candidates;
use report::Clock;

/// How weights are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Heat that flows along the surface from the bones nearest to each vertex, "near" taken through the inside of the
    /// mesh and in front of the surface: the one to use.
    Heat,
    /// Inverse distances to the nearest bones, through the inside of the mesh: for comparison.
    Geodesic,
    /// Inverse straight distances to the nearest bones, as the paper has it: needs no inside, and bleeds across gaps.
    Euclidean,
}

impl Method {
    /// Every method.
    pub const ALL: [Self; 3] = [Self::Heat, Self::Geodesic, Self::Euclidean];
}

/// Settings of [`automatic_weights`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// How weights are computed.
    pub method: Method,
    /// Most influences per vertex, 0 for no limit.
    pub max_influences: usize,
    /// Cells along the diameter of the mesh, through which distances are measured; 16 to 512.
    pub resolution: f64,
    /// [`Method::Heat`]: how closely heat keeps to its bone (c of the equation), 0.01 to 1000; less blends more widely.
    pub stiffness: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { method: Method::Heat, max_influences: 4, resolution: 128.0, stiffness: 5.0 }
    }
}

impl Settings {
    /// # Errors
    /// [`Error::InvalidParameter`] with the first one out of range.
    pub fn check(&self) -> Result<()> {
        let in_range = |name, value, low, high, must| {
            if (low..=high).contains(&value) { Ok(()) } else { Err(Error::InvalidParameter { name, value, must }) }
        };
        in_range("resolution", self.resolution, 16.0, 512.0, "must be from 16 to 512")?;
        in_range("stiffness", self.stiffness, 0.01, 1000.0, "must be from 0.01 to 1000")
    }
}

/// Weights and what is to be said about them.
#[derive(Debug, Clone, PartialEq)]
pub struct AutoWeights {
    /// One row per vertex, none empty, each summing to 1.
    pub weights: Weights,
    /// Counts, warnings and times.
    pub report: Report,
}

/// Computes weights of all vertices of `mesh` for the bones of `skeleton`, in one space. Coincident vertices get equal rows.
///
/// # Errors
/// [`Error::InvalidSkeleton`], [`Error::InvalidParameter`], [`Error::Cancelled`], [`Error::NotPositiveDefinite`].
///
/// # Example
/// ```
/// use skinwright_core::autoskin::{Settings, Skeleton, automatic_weights};
/// use skinwright_core::{Progress, TriMesh};
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/read/mod.rs"));
/// # fn main() -> Result<(), Box<dyn AnyError>> {
/// # let (positions, triangles) = mesh(data("arm.obj"))?;
/// let arm = TriMesh::new(&positions, &triangles, "arm")?;
/// let segments = [[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]];
/// let skeleton = Skeleton { segments: &segments, parents: &[-1, 0] };
/// let automatic = automatic_weights(&arm, &skeleton, &Settings::default(), &Progress::default())?;
/// assert_eq!(automatic.report.unweighted, 0);
/// # Ok(())
/// # }
/// ```
pub fn automatic_weights(
    mesh: &TriMesh<'_>,
    skeleton: &Skeleton<'_>,
    settings: &Settings,
    progress: &Progress,
) -> Result<AutoWeights> {
    settings.check()?;
    skeleton.check(mesh)?;
    let mut clock = Clock::default();
    let welded = Welded::new(mesh);
    let vertices = mesh.vertex_count();
    let positions: Vec<[f32; 3]> = welded.first.iter().map(|&i| mesh.positions()[i as usize]).collect();
    let mut report = Report { vertices, distinct: positions.len(), ..Report::default() };
    let mesh = TriMesh::new(&positions, &welded.triangles, "rest")?;
    let weights = match settings.method {
        Method::Euclidean => inverse_distance::euclidean(&mesh, skeleton),
        method => {
            let candidates = Candidates::new(&mesh, skeleton, settings.resolution, progress, &mut report)?;
            clock.lap("distances", &mut report);
            match method {
                Method::Heat => heat::solve(&mesh, &candidates, settings.stiffness, progress, &mut report)?,
                _ => inverse_distance::geodesic(&mesh, skeleton, &candidates),
            }
        }
    };
    clock.lap("weights", &mut report);
    let weights = limit(weights, settings.max_influences).take_rows(&welded.of_vertex);
    report.count(&weights);
    progress.report(1.0);
    Ok(AutoWeights { weights, report })
}
