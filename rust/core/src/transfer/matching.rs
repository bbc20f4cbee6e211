//! Step 1: which target vertices take their weights straight from the source (paper section 3.1).

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Source;
use crate::mesh::TriMesh;
use crate::surface::SurfacePoint;

/// What the artist asks of one vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum MaskValue {
    /// Never match, always inpaint.
    Inpaint = 0,
    /// Let distance and angle decide.
    Automatic = 1,
    /// Match whatever distance and angle say.
    ForceMatch = 2,
}

/// When a vertex matches its closest point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Largest distance, world units.
    pub max_distance: f64,
    /// Largest angle between the normals, radians.
    pub max_normal_angle: f64,
    /// Whether a normal that points the opposite way matches too (inner layers, linings).
    pub match_flipped_normals: bool,
}

/// The closest source point of every target vertex, found once; criteria are applied to it as often as wanted.
#[derive(Debug)]
pub struct Closest {
    /// Closest point of each vertex (V).
    pub points: Vec<SurfacePoint>,
    /// Angle between target and source normal (V), radians in [0, pi], NaN where either has no length.
    pub angles: Vec<f32>,
    /// Whether the source has any weight at the point (V).
    weighted: Vec<bool>,
}

impl Closest {
    /// Finds the closest points of all vertices of `target` on `source`.
    pub fn new(source: &Source, target: &TriMesh<'_>) -> Self {
        let points = source.index().closest_points(target.positions());
        let normals = target.vertex_normals();
        let angles = points.par_iter().zip(&normals).map(|(point, normal)| angle(source, point, *normal)).collect();
        let weighted = source.weighted(&points);
        Self { points, angles, weighted }
    }

    /// Recomputes which points have weights after the source's weights changed.
    pub fn refresh_weighted(&mut self, source: &Source) {
        self.weighted = source.weighted(&self.points);
    }

    /// Applies `criteria` and the artist's `mask` (V, automatic everywhere if absent); (V).
    pub fn matched(&self, criteria: &Criteria, mask: Option<&[MaskValue]>) -> Vec<bool> {
        let decide = |i: usize| match mask.map_or(MaskValue::Automatic, |mask| mask[i]) {
            MaskValue::Inpaint => false,
            MaskValue::ForceMatch => self.weighted[i],
            MaskValue::Automatic => {
                self.weighted[i] && self.points[i].distance <= criteria.max_distance && self.agrees(i, criteria)
            }
        };
        (0..self.points.len()).into_par_iter().map(decide).collect()
    }

    /// Whether the normals at vertex `i` agree; NaN never does.
    fn agrees(&self, i: usize, criteria: &Criteria) -> bool {
        let angle = f64::from(self.angles[i]);
        let flipped = criteria.match_flipped_normals && std::f64::consts::PI - angle <= criteria.max_normal_angle;
        angle <= criteria.max_normal_angle || flipped
    }

    /// The smallest distance at which some vertex would match, were `max_distance` that large.
    pub fn smallest_matching_distance(&self, criteria: &Criteria, mask: Option<&[MaskValue]>) -> Option<f64> {
        let any_distance = Criteria { max_distance: f64::INFINITY, ..*criteria };
        let possible = self.matched(&any_distance, mask);
        let distances = self.points.iter().zip(possible).filter(|(_, possible)| *possible);
        distances.map(|(point, _)| point.distance).min_by(f64::total_cmp)
    }
}

/// Angle between a target normal and the source normal at `point`, which is the barycentric blend of the
/// vertex normals. By atan2, so that equal normals give exactly zero.
fn angle(source: &Source, point: &SurfacePoint, target_normal: Vec3) -> f32 {
    let corners = source.triangles()[point.triangle as usize];
    let blend: DVec3 = std::iter::zip(corners, point.barycentric)
        .map(|(i, share)| source.normals()[i as usize].as_dvec3() * share)
        .sum();
    let normal = target_normal.as_dvec3();
    if blend.length_squared() == 0.0 || normal.length_squared() == 0.0 {
        return f32::NAN;
    }
    normal.cross(blend).length().atan2(normal.dot(blend)) as f32
}
