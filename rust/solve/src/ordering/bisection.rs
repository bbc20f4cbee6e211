//! Halving a point cloud by a plane.

use glam::{DMat3, DVec3, Vec3};

/// An unknown on its way to its place.
#[derive(Clone, Copy)]
pub(crate) struct Point {
    pub(crate) position: Vec3,
    /// Distance to the farthest neighbour.
    pub(crate) reach: f32,
    pub(crate) unknown: u32,
    /// Place along the axis of the cut at hand.
    pub(crate) key: f32,
}

/// A plane through the point cloud; points on it are told apart by their index.
#[derive(Clone, Copy)]
pub(crate) struct Plane {
    axis: Vec3,
    origin: Vec3,
    pub(crate) key: f32,
    unknown: u32,
}

impl Plane {
    /// Whether the point lies in the lower half.
    pub(crate) fn is_below(&self, position: Vec3, unknown: u32) -> bool {
        let key = self.axis.dot(position - self.origin);
        key.total_cmp(&self.key).then(unknown.cmp(&self.unknown)).is_lt()
    }
}

/// Puts the lower half of `points` along `axis` first. The same half only from the same `origin`: another one rounds
/// otherwise, and points that lie in one plane change sides.
pub(crate) fn halve(points: &mut [Point], axis: Vec3, origin: Vec3) -> Plane {
    for point in points.iter_mut() {
        point.key = axis.dot(point.position - origin);
    }
    let middle = points.len() / 2;
    let order = |a: &Point, b: &Point| a.key.total_cmp(&b.key).then(a.unknown.cmp(&b.unknown));
    let (_, median, _) = points.select_nth_unstable_by(middle, order);
    Plane { axis, origin, key: median.key, unknown: median.unknown }
}

/// Directions of greatest and second extent. (Across the third, a surface is cut worst.)
pub(crate) fn principal_axes(points: &[Point]) -> [Vec3; 2] {
    let origin = points[0].position;
    let (mut sum, mut squares) = (DVec3::ZERO, DMat3::ZERO);
    for point in points {
        let p = (point.position - origin).as_dvec3();
        sum += p;
        squares += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
    }
    let mean = sum / points.len() as f64;
    let covariance =
        squares * (1.0 / points.len() as f64) - DMat3::from_cols(mean * mean.x, mean * mean.y, mean * mean.z);
    let first = dominant_axis(covariance);
    let spread = first.dot(covariance * first);
    let second =
        dominant_axis(covariance - DMat3::from_cols(first * first.x, first * first.y, first * first.z) * spread);
    let second = (second - first * first.dot(second)).try_normalize().unwrap_or(first.any_orthonormal_vector());
    [first.as_vec3(), second.as_vec3()]
}

/// Unit eigenvector of the largest eigenvalue, near enough, by repeated squaring.
fn dominant_axis(covariance: DMat3) -> DVec3 {
    let mut power = covariance;
    for _ in 0..8 {
        let scale = power.x_axis.x + power.y_axis.y + power.z_axis.z;
        power *= 1.0 / scale.max(f64::MIN_POSITIVE);
        power = power * power;
    }
    let columns = [power.x_axis, power.y_axis, power.z_axis];
    let longest = columns.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    longest.and_then(DVec3::try_normalize).unwrap_or(DVec3::X)
}
