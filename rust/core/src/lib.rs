//! Skin weights for character meshes, without any I/O or Python: the numerics of Skinwright.
//!
//! Operations, each a module: [`transfer`] moves weights from a body to garments, [`desparsify`] gives vertices more
//! candidate bones, [`sculpt`] turns what was sculpted on a posed character into weights, [`autoskin`] makes first weights,
//! [`embed`] puts a skeleton into a mesh, [`retarget`] moves weights between characters, [`refine`] moves skin around bent
//! joints. Operations know nothing of each other.
//!
//! Parts, on which they are built and which know nothing of them: [`TriMesh`], [`Weights`], [`Weld`], [`Progress`], and the
//! modules [`adjacency`], [`biharmonic`], [`fill`], [`inside`], [`laplacian`], [`penetration`], [`skinning`], [`surface`].
//!
//! Geometry is `f32` in one space per call, solves are `f64`, angles are radians, weights are sparse rows (CSR). Answers do
//! not depend on the number of threads, to the bit. `examples/` has programs to start from.
#![forbid(unsafe_code)]
#![deny(rustdoc::broken_intra_doc_links)]

pub mod adjacency;
pub mod autoskin;
pub mod biharmonic;
mod bones;
pub mod desparsify;
pub mod embed;
mod error;
pub mod fill;
pub mod inside;
pub mod laplacian;
mod limit;
mod mesh;
pub mod penetration;
mod progress;
pub mod refine;
mod registration;
pub mod retarget;
pub mod sculpt;
pub mod skinning;
pub mod surface;
pub mod transfer;
mod weights;
mod weld;
mod welded;

pub use error::{Error, Result};
pub use mesh::TriMesh;
pub use progress::Progress;
pub use weights::Weights;
pub use weld::Weld;
