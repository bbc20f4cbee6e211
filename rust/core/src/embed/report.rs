//! What is to be said about an embedding.

/// Counts and times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Places that the joints were chosen from.
    pub places: usize,
    /// Joints that were placed by themselves: branches and extremities.
    pub main_joints: usize,
    /// Whether mesh and template are both mirror images of themselves, so that sides were placed as such.
    pub symmetric: bool,
    /// Bones whose head is not inside of the mesh.
    pub outside: Vec<u32>,
    /// Penalty of the embedding, the sum over its parts.
    pub penalty: f64,
    /// Seconds that it took.
    pub seconds: f64,
}
