//! What can go wrong, in the words the artist reads.

/// The result of every fallible operation of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Every failure a caller can act on. The `what` fields name an input: "source", "target", ...
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// A mesh without a single triangle.
    #[error("the {what} mesh has no triangles")]
    NoTriangles {
        /// Which mesh.
        what: &'static str,
    },
    /// A NaN or infinite coordinate.
    #[error("the {what} mesh has a position that is not finite at vertex {vertex}")]
    PositionNotFinite {
        /// Which mesh.
        what: &'static str,
        /// First offending vertex.
        vertex: usize,
    },
    /// A triangle that names a vertex which is not there.
    #[error("triangle {triangle} of the {what} mesh names vertex {vertex}, but there are only {count}")]
    VertexOutOfRange {
        /// Which mesh.
        what: &'static str,
        /// First offending triangle.
        triangle: usize,
        /// The index it names.
        vertex: u32,
        /// Number of vertices.
        count: usize,
    },
    /// An edge that names a vertex which is not there.
    #[error("edge {edge} of the {what} mesh names a vertex that is not there, there are only {count}")]
    EdgeOutOfRange {
        /// Which mesh.
        what: &'static str,
        /// First offending edge.
        edge: usize,
        /// Number of vertices.
        count: usize,
    },
    /// A weight that is NaN or infinite.
    #[error("vertex {vertex} has a weight that is not finite (bone {bone})")]
    WeightNotFinite {
        /// First offending vertex.
        vertex: usize,
        /// Bone of the offending entry.
        bone: u32,
    },
    /// A negative weight where only influences make sense.
    #[error("vertex {vertex} has a negative weight (bone {bone})")]
    WeightNegative {
        /// First offending vertex.
        vertex: usize,
        /// Bone of the offending entry.
        bone: u32,
    },
    /// CSR arrays that do not describe a matrix.
    #[error("the weight arrays do not fit together: {reason}")]
    InvalidWeights {
        /// What does not fit.
        reason: String,
    },
    /// Two inputs whose lengths must agree do not.
    #[error("{what} has {found} entries where {expected} are needed")]
    LengthMismatch {
        /// The input's name.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length it must have.
        expected: usize,
    },
    /// A parameter outside of its range.
    #[error("{name} is {value}, but {must}")]
    InvalidParameter {
        /// The parameter's name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        must: &'static str,
    },
    /// No target vertex lies close enough to the source.
    #[error("nothing matched: no vertex lies within the distance now in force, {max_distance:.6}; {advice}")]
    NothingMatched {
        /// The distance in force, in world units.
        max_distance: f64,
        /// Smallest distance that would match something, if any would.
        needed: Option<f64>,
        /// What to do about it.
        advice: String,
    },
    /// A block of the system is not positive definite.
    #[error("the inpainting system of the island around vertex {vertex} cannot be solved (pivot not positive)")]
    NotPositiveDefinite {
        /// A vertex of the offending block.
        vertex: usize,
    },
    /// A bone that has no direction, no length or no finite place.
    #[error("bone {bone} of the {what} {problem}")]
    UnusableBone {
        /// Which character.
        what: &'static str,
        /// Index of the bone.
        bone: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// No bone of one character has a partner in the other.
    #[error(
        "the two characters have no weighted bone in common: map at least one bone of the target to a bone of the source"
    )]
    NoCommonBones,
    /// Bones that cannot be used.
    #[error("the skeleton cannot be used: {reason}")]
    InvalidSkeleton {
        /// What is wrong, and what to do about it.
        reason: String,
    },
    /// A mesh without an inside for tetrahedra.
    #[error(
        "the mesh encloses nothing: no tetrahedron lies inside of it; it needs thickness, and normals that point outwards"
    )]
    NothingInside,
    /// A mesh beyond what an operation can take.
    #[error("the mesh has {found} vertices, but at most {most} can be refined; bake a lighter version")]
    TooManyVertices {
        /// Number of vertices.
        found: usize,
        /// The most there may be.
        most: usize,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}
