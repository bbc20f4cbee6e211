//! Weights of one character for another with a matching skeleton.
//!
//! The way: `skeleton` reads both skeletons and the map between them; `warp` brings the target into the source's rest pose and
//! proportions, `placed` draws it onto the source; `matching` finds the source point of each vertex, or `biharmonic` a
//! blend of source vertices; `shares` turns the source's bones into the target's; `confidence` says which matches to
//! believe, and the others are filled from around them; then smoothing and the limit.

mod alignment;
mod biharmonic;
mod confidence;
mod finish;
mod placed;
mod prepared;
mod rows;
mod settings;
mod shares;
mod skeleton;
mod warp;

use std::time::Instant;

pub use crate::registration::MatchPoints;
pub use biharmonic::Landmark;
pub use settings::{Method, Settings};
pub use skeleton::{BonePair, RestBone, Skeleton};

use crate::error::Result;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::weights::Weights;
use prepared::Prepared;

/// A character at rest: mesh and skeleton in one space.
#[derive(Debug, Clone, Copy)]
pub struct Character<'a> {
    /// Its surface, checked.
    pub mesh: TriMesh<'a>,
    /// Its bones.
    pub skeleton: &'a Skeleton,
}

/// How the two characters belong together.
#[derive(Debug, Clone, Copy)]
pub struct Correspondence<'a> {
    /// The source's bone for each of the target's, negative for none.
    pub bone_map: &'a [i32],
    /// Parents of the source's bones, negative for a root; say who inherits from a bone without a partner.
    pub source_parents: Option<&'a [i32]>,
    /// Pairs of vertices for the Biharmonic method, beside those that the bones give.
    pub landmarks: &'a [Landmark],
}

/// Retargeted weights; every array has one entry per target vertex.
#[derive(Debug, Clone)]
pub struct Retarget {
    /// Weights over the target's bones.
    pub weights: Weights,
    /// How far each match is to be believed, 0 to 1.
    pub confidence: Vec<f32>,
    /// Whether the vertex has the weights of its match; the others are filled from around them.
    pub matched: Vec<bool>,
    /// Where on the source each vertex belongs, in the source's space.
    pub points: Vec<[f32; 3]>,
    /// What was done.
    pub report: Report,
}

/// What a retargeting did.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    /// Number of target vertices.
    pub vertices: usize,
    /// Those with the weights of their match.
    pub matched: usize,
    /// Those filled from around them.
    pub filled: usize,
    /// Those without any weight, because the source has none there.
    pub unweighted: usize,
    /// Pairs of bones that guided the warp.
    pub bones: usize,
    /// Weighted bones of the source without a partner, and the bone of the source whose partners took their share.
    pub inherited: Vec<(u32, u32)>,
    /// Bones of the target without a partner.
    pub without_partner: Vec<u32>,
    /// Whether vertices were matched by their numbers, as both meshes are one in two shapes.
    pub by_number: bool,
    /// Landmarks in force, those of the bones included.
    pub landmarks: usize,
    /// Vertices matched by biharmonic distances; the others by the skeleton.
    pub by_landmarks: usize,
    /// Size of the source relative to the target.
    pub size_ratio: f64,
    /// Seconds per step.
    pub seconds: Vec<(&'static str, f64)>,
}

/// Retargets `weights` (the source's vertices) from `source` to `target`.
///
/// # Errors
/// [`Error::LengthMismatch`](crate::Error::LengthMismatch), [`Error::WeightNegative`](crate::Error::WeightNegative),
/// [`Error::InvalidParameter`](crate::Error::InvalidParameter), [`Error::NoCommonBones`](crate::Error::NoCommonBones),
/// [`Error::UnusableBone`](crate::Error::UnusableBone), [`Error::Cancelled`](crate::Error::Cancelled).
///
/// # Example
/// The weights of an arm for an arm twice as large:
/// ```
/// use skinwright_core::retarget::{Character, Correspondence, Settings, Skeleton, retarget};
/// use skinwright_core::{Progress, TriMesh};
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/read/mod.rs"));
/// # fn main() -> Result<(), Box<dyn AnyError>> {
/// # let (small, triangles) = mesh(data("arm.obj"))?;
/// # let painted = weights(data("arm.weights"), small.len())?;
/// let large: Vec<_> = small.iter().map(|p| p.map(|x| 2.0 * x)).collect();
/// // Bones along x: the frame's columns are its axes, y along the bone, and its head.
/// let bone = |x: f64| [[0.0, 1.0, 0.0, x], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
/// let of_small = Skeleton::new(&[bone(0.0), bone(0.5)], &[0.5, 0.5], "source")?;
/// let of_large = Skeleton::new(&[bone(0.0), bone(1.0)], &[1.0, 1.0], "target")?;
/// let source = Character { mesh: TriMesh::new(&small, &triangles, "source")?, skeleton: &of_small };
/// let target = Character { mesh: TriMesh::new(&large, &triangles, "target")?, skeleton: &of_large };
/// let pairs = Correspondence { bone_map: &[0, 1], source_parents: None, landmarks: &[] };
/// let retargeted = retarget(source, &painted, target, pairs, &Settings::default(), &Progress::default())?;
/// assert_eq!(retargeted.report.unweighted, 0);
/// # Ok(())
/// # }
/// ```
pub fn retarget(
    source: Character<'_>,
    weights: &Weights,
    target: Character<'_>,
    correspondence: Correspondence<'_>,
    settings: &Settings,
    progress: &Progress,
) -> Result<Retarget> {
    let mut stages = Stages { start: Instant::now(), seconds: Vec::new() };
    let prepared = Prepared::new(source, weights, target, correspondence, settings)?;
    stages.end("prepare");
    let mut placed = prepared.place(progress)?;
    stages.end("match");
    let mut rows = prepared.rows_of(&placed.matches);
    let mut report = Report { by_number: placed.by_number, ..prepared.report() };
    if settings.method == Method::Biharmonic {
        (report.landmarks, report.by_landmarks) = prepared.replace_by_landmarks(&mut placed, &mut rows, progress)?;
        stages.end("landmarks");
    }
    let confidence = confidence::of_matches(&placed, &prepared.target, prepared.size, settings);
    let reliable: Vec<bool> =
        std::iter::zip(&confidence, &rows).map(|(&c, row)| c >= confidence::RELIABLE && !row.is_empty()).collect();
    let finish = finish::Finish::new(rows, &reliable, &prepared.target, target.mesh.diagonal())?;
    let weights = finish.weights(target.skeleton.bones().len() as u32, settings, progress)?;
    stages.end("finish");
    progress.report(1.0);
    let of_vertex = || prepared.target.of_vertex.iter().map(|&u| u as usize);
    let matched: Vec<bool> = of_vertex().map(|u| reliable[u]).collect();
    report.matched = matched.iter().filter(|&&matched| matched).count();
    report.filled = report.vertices - report.matched;
    report.unweighted = weights.indptr().windows(2).filter(|w| w[0] == w[1]).count();
    report.seconds = stages.seconds;
    Ok(Retarget {
        confidence: of_vertex().map(|u| confidence[u] as f32).collect(),
        points: of_vertex().map(|u| placed.matches[u].position.as_vec3().to_array()).collect(),
        weights,
        matched,
        report,
    })
}

/// A stopwatch over consecutive steps.
struct Stages {
    start: Instant,
    seconds: Vec<(&'static str, f64)>,
}

impl Stages {
    fn end(&mut self, name: &'static str) {
        self.seconds.push((name, self.start.elapsed().as_secs_f64()));
        self.start = Instant::now();
    }
}
