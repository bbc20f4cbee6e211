//! The numerics of Skinwright: skin-weight transfer, desparsification and sculpt-to-weights.
//!
//! Parts (mesh, surface, linear solver, ...) know nothing of the operations built on them, and
//! operations know nothing of each other. Geometry is `f32` in world space, solves are `f64`,
//! angles are radians, weights are CSR.
#![forbid(unsafe_code)]

pub mod adjacency;
pub mod autoskin;
pub mod biharmonic;
pub mod desparsify;
pub mod embed;
pub mod error;
pub mod fill;
pub mod inside;
pub mod laplacian;
pub mod limit;
pub mod mesh;
pub mod penetration;
pub mod progress;
pub mod refine;
mod registration;
pub mod retarget;
pub mod sculpt;
pub mod skinning;
pub mod surface;
pub mod transfer;
pub mod weights;
pub mod weld;
mod welded;

pub use error::{Error, Result};
pub use mesh::TriMesh;
pub use progress::Progress;
pub use weights::Weights;
pub use weld::Weld;
