//! Closest points on a triangle mesh.

use crate::mesh::TriMesh;

/// A point on a surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SurfacePoint {
    /// Index of the triangle.
    pub triangle: u32,
    /// Barycentric coordinates, non-negative, summing to 1.
    pub barycentric: [f64; 3],
    /// Distance from the query, world units.
    pub distance: f64,
}

/// A mesh prepared for closest-point queries (bounding volume hierarchy).
#[derive(Debug)]
pub struct SurfaceIndex {}

impl SurfaceIndex {
    /// Builds the hierarchy over all triangles of `mesh`.
    pub fn new(_mesh: &TriMesh<'_>) -> Self {
        unimplemented!()
    }

    /// Exact closest point for each query (Q, 3), in the queries' order, on rayon's current pool.
    pub fn closest_points(&self, _queries: &[[f32; 3]]) -> Vec<SurfacePoint> {
        unimplemented!()
    }
}
