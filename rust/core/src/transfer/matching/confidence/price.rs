//! The cost of a point: its squared distance, and what its direction adds.

use glam::{DVec3, Vec3};

use crate::surface::SurfacePoint;
use crate::transfer::Source;

/// mu: opposite normals cost as much as a distance of twice this share of the source's size.
pub(super) const DIRECTION: f64 = 0.015;

/// Cost of a point at a distance whose normal has a cosine with the vertex's; without a normal only distance counts.
pub(super) fn cost(distance: f64, cosine: Option<f64>, size: f64) -> f64 {
    let direction = DIRECTION * size;
    distance * distance + 2.0 * direction * direction * (1.0 - cosine.unwrap_or(1.0))
}

/// Cosine between a vertex's normal and the source's normal at `point`, None where either has no length.
pub(super) fn cosine(source: &Source, point: &SurfacePoint, normal: Vec3) -> Option<f64> {
    let (blend, normal) = (blend(source, point), normal.as_dvec3());
    let lengths = blend.length() * normal.length();
    (lengths > 0.0).then(|| (blend.dot(normal) / lengths).clamp(-1.0, 1.0))
}

/// The source's normal at `point`, of any length.
pub(super) fn blend(source: &Source, point: &SurfacePoint) -> DVec3 {
    let corners = source.triangles()[point.triangle as usize];
    let normals = corners.map(|i| source.normals()[i as usize].as_dvec3());
    std::iter::zip(normals, point.barycentric).map(|(normal, share)| normal * share).sum()
}
