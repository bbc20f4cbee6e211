//! Orders the unknowns by cutting the point cloud in half again and again (nested dissection).

pub(crate) mod bisection;
pub(crate) mod dissection;
pub(crate) mod graph;
pub(crate) mod patch;
pub(crate) mod vertex_cover;
