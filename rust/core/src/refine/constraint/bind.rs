//! Skin does not leave its bone.

use glam::Vec3;

/// The two bones of a joint as rays from it, posed.
#[derive(Debug, Clone, Copy)]
pub struct Axis {
    /// The joint.
    pub origin: Vec3,
    /// Unit directions of the parent's and the child's bone, away from the joint.
    pub directions: [Vec3; 2],
}

impl Axis {
    /// From the nearest point of the rays to `point`.
    pub fn offset(&self, point: Vec3) -> Vec3 {
        let arm = point - self.origin;
        let [a, b] = self.directions.map(|direction| arm - direction * arm.dot(direction).max(0.0));
        if b.length_squared() < a.length_squared() { b } else { a }
    }

    /// Where `point` lies along the rays: negative on the parent's.
    pub fn along(&self, point: Vec3) -> f32 {
        let arm = point - self.origin;
        let [a, b] = self.directions.map(|direction| arm.dot(direction).max(0.0));
        if b > a { b } else { -a }
    }
}

/// The move that brings `point` back to at most `farthest` and at least `nearest` from the bones, if it is not there.
///
/// One-sided from above by default (`nearest` 0): a bend must be free to flatten its inner side.
pub fn bind(axis: &Axis, point: Vec3, nearest: f32, farthest: f32) -> Vec3 {
    let offset = axis.offset(point);
    let distance = offset.length();
    if distance > farthest {
        offset * (farthest / distance - 1.0)
    } else if distance < nearest {
        offset.normalize_or_zero() * (nearest - distance)
    } else {
        Vec3::ZERO
    }
}
