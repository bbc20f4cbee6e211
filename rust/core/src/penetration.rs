//! How deep points lie inside a surface, at rest and in poses.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::error::Result;
use crate::mesh::TriMesh;
use crate::skinning::linear_blend;
use crate::surface::{SurfaceIndex, SurfacePoint};
use crate::weights::Weights;

/// A skinned mesh: rest positions (V) in world units and one row of weights per vertex.
#[derive(Debug, Clone, Copy)]
pub struct Skinned<'a> {
    /// Rest positions, (V, 3).
    pub rest: &'a [[f32; 3]],
    /// V rows.
    pub weights: &'a Weights,
}

/// Depth of each of `points` (n, 3) below its closest triangle of `mesh`, world units; 0 outside.
///
/// A point is inside if it lies behind the closest triangle. Triangles wind so that their normals face outward.
pub fn depths(mesh: &TriMesh<'_>, points: &[[f32; 3]]) -> Vec<f32> {
    let index = SurfaceIndex::new(mesh);
    let closest = index.closest_points(points);
    points.iter().zip(closest).map(|(&point, closest)| depth(mesh, point, closest)).collect()
}

/// The same in poses: row p has the depths of the points of `garment` inside `body` where the bones' transforms
/// `poses[p]` take both.
///
/// # Errors
/// Those of [`TriMesh::new`], for a posed body.
pub fn depths_in_poses(
    body: Skinned<'_>,
    triangles: &[[u32; 3]],
    garment: Skinned<'_>,
    poses: &[Vec<DAffine3>],
) -> Result<Vec<Vec<f32>>> {
    let in_pose = |pose: &Vec<DAffine3>| {
        let posed = linear_blend(body.rest, body.weights, pose)?;
        let mesh = TriMesh::new(&posed, triangles, "source")?;
        Ok(depths(&mesh, &linear_blend(garment.rest, garment.weights, pose)?))
    };
    poses.par_iter().map(in_pose).collect()
}

fn depth(mesh: &TriMesh<'_>, point: [f32; 3], closest: SurfacePoint) -> f32 {
    let corners =
        mesh.triangles()[closest.triangle as usize].map(|i| DVec3::from(mesh.positions()[i as usize].map(f64::from)));
    let [a, b, c] = corners;
    let on_it: DVec3 = corners.iter().zip(closest.barycentric).map(|(&corner, share)| share * corner).sum();
    let outward = (b - a).cross(c - a).normalize_or_zero();
    outward.dot(on_it - DVec3::from(point.map(f64::from))).max(0.0) as f32
}
