//! Skin of two bones meets in the plane between them.

use glam::Vec3;

/// The plane that halves the angle between two bones, through their joint.
#[derive(Debug, Clone, Copy)]
pub struct HalfSpace {
    /// A point of the plane.
    pub origin: Vec3,
    /// Unit normal, towards the child's bone.
    pub normal: Vec3,
    /// Distance to keep from the plane.
    pub gap: f32,
}

impl HalfSpace {
    /// Lowest and highest that a point may be above the plane, by its side as in [`Self::depth`]; skin that lies in it at
    /// rest stays between the two sides.
    pub fn heights(&self, side: f32) -> [f32; 2] {
        if side > 0.0 {
            [self.gap, f32::INFINITY]
        } else if side < 0.0 {
            [f32::NEG_INFINITY, -self.gap]
        } else {
            [-self.gap / 2.0, self.gap / 2.0]
        }
    }

    /// How far inside of its half `point` lies, negative beyond the plane; `side` is +1 for the child's, -1 for the
    /// parent's, 0 for what lies in the plane.
    pub fn depth(&self, point: Vec3, side: f32) -> f32 {
        (point - self.origin).dot(self.normal) * side - self.gap
    }
}

/// The move that brings `point` back between the lowest and the highest that it may be above the plane.
pub fn self_collision(plane: &HalfSpace, point: Vec3, [lowest, highest]: [f32; 2]) -> Vec3 {
    let height = (point - plane.origin).dot(plane.normal);
    // Not `clamp`: it panics without an order between the two, as a pose that is not a number leaves it.
    plane.normal * (height.max(lowest).min(highest) - height)
}
