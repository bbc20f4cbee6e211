//! What a refinement did, in figures.

/// Figures of one joint in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct JointReport {
    /// The bone below the joint.
    pub bone: usize,
    /// Angle of the whole rotation against the parent, radians.
    pub angle: f64,
    /// Volume of the joint's region against rest, of the skin as dual quaternions leave it and as refined: -0.02 is 2 % lost.
    pub volume_before: f64,
    /// The same, refined.
    pub volume_after: f64,
    /// Farthest that skin came from its bone, as a multiple of the distance at rest, before.
    pub bulge_before: f64,
    /// The same, refined.
    pub bulge_after: f64,
    /// Whether the joint has a plane between its bones.
    pub is_limb: bool,
}

/// Figures of one joint for skin that anybody posed.
#[derive(Debug, Clone, PartialEq)]
pub struct JointMeasure {
    /// The bone below the joint.
    pub bone: usize,
    /// Volume of the joint's region against rest: -0.02 is 2 % lost. None for shoulders and the like: beside a body's trunk there
    /// is no volume about a joint.
    pub volume: Option<f64>,
    /// Farthest that skin is from its bone, as a multiple of the distance at rest.
    pub bulge: f64,
}

/// Figures of one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Every joint that was active.
    pub joints: Vec<JointReport>,
    /// Pairs of triangles that pass through each other at rest.
    pub pairs_at_rest: usize,
    /// Pairs under dual quaternions.
    pub pairs_before: usize,
    /// Pairs as refined.
    pub pairs_after: usize,
    /// Tetrahedra that took part.
    pub active_tetrahedra: usize,
    /// Those of them turned inside out at the end.
    pub inverted_tetrahedra: usize,
    /// Constraints projected in each iteration.
    pub constraints: usize,
    /// Projections of all constraints.
    pub iterations: usize,
    /// Tetrahedra of the whole lattice, those that are copies, and its nodes.
    pub tetrahedra: usize,
    /// Copies, where skin of two limbs lies in one cell.
    pub cloned_tetrahedra: usize,
    /// Nodes of the whole lattice.
    pub nodes: usize,
    /// Name and milliseconds of each stage.
    pub stages: Vec<(&'static str, f64)>,
}
