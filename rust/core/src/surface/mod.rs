//! Closest points on a triangle mesh.

mod bvh;
mod closest_point;

use glam::Vec3;
use rayon::prelude::*;

use crate::mesh::TriMesh;
use bvh::Bvh;
use closest_point::closest_on_triangle;

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
///
/// Answers are exact and unique: the triangle with the smallest squared distance in f64 arithmetic, of equal ones the
/// lowest index, whatever the number of threads and the order of the queries.
#[derive(Debug)]
pub struct SurfaceIndex {
    bvh: Bvh,
    /// Corners of the indexed triangles, world space.
    corners: Vec<[Vec3; 3]>,
    /// The mesh's index of each of them, ascending.
    triangles: Vec<u32>,
}

impl SurfaceIndex {
    /// Builds the hierarchy over all triangles of `mesh`.
    pub fn new(mesh: &TriMesh<'_>) -> Self {
        Self::build(mesh, (0..mesh.triangles().len() as u32).collect()).expect("a TriMesh has a triangle")
    }

    /// Builds the hierarchy over some triangles of `mesh` (indices, in any order); answers name the mesh's triangles.
    ///
    /// None if `triangles` is empty. Panics if an index is out of range.
    pub fn of_triangles(mesh: &TriMesh<'_>, triangles: &[u32]) -> Option<Self> {
        let mut triangles = triangles.to_vec();
        triangles.sort_unstable();
        Self::build(mesh, triangles)
    }

    fn build(mesh: &TriMesh<'_>, triangles: Vec<u32>) -> Option<Self> {
        let corner = |i: u32| Vec3::from(mesh.positions()[i as usize]);
        let corners: Vec<_> = triangles.iter().map(|&t| mesh.triangles()[t as usize].map(corner)).collect();
        (!corners.is_empty()).then(|| Self { bvh: Bvh::new(&corners), corners, triangles })
    }

    /// Exact closest point for each query (Q, 3), in the queries' order, on rayon's current pool.
    pub fn closest_points(&self, queries: &[[f32; 3]]) -> Vec<SurfacePoint> {
        queries.par_iter().map(|&q| self.closest_point(q)).collect()
    }

    /// Exact closest point for one query, world space, finite.
    pub fn closest_point(&self, query: [f32; 3]) -> SurfacePoint {
        let query = Vec3::from(query);
        let nearest = self.bvh.nearest(query, &self.corners);
        let corners = self.corners[nearest as usize].map(|p| p.as_dvec3());
        let (barycentric, squared) = closest_on_triangle(query.as_dvec3(), corners);
        SurfacePoint { triangle: self.triangles[nearest as usize], barycentric, distance: squared.sqrt() }
    }
}
