//! Which points lie inside a mesh, whatever the mesh: open, overlapping, of many islands, non-manifold.

mod moments;
mod solid_angle;
mod tree;
mod winding;

pub use winding::Winding;
