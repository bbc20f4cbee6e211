//! Which points lie inside a mesh, whatever the mesh: open, overlapping, of many islands, non-manifold; and how far it is
//! from one to another without leaving it.

mod bridges;
mod cells;
mod lattice;
mod moments;
mod paths;
mod rasterise;
mod solid_angle;
mod tree;
mod winding;

pub use cells::Cells;
pub use lattice::Lattice;
pub use paths::{Paths, UNREACHED};
pub use winding::Winding;
