//! What the skin of a frame's joints may not leave: the distance from its bones, the plane between them, the membrane in
//! their crease.

use super::constraint::{Axis, HalfSpace};
use super::crease::Crease;
use super::frame::ActiveJoint;
use super::projection::Limits;
use super::solver::Frame;

/// Depth above the plane up to which skin counts as in contact for the balloon, in radii.
const IN_CONTACT: f32 = 0.04;

impl Frame<'_> {
    /// Bind, planes and membranes of every joint, for its skin.
    pub(super) fn limit(&mut self, axes: &[Axis], share: f32, passes: usize) {
        for (k, axis) in axes.iter().enumerate() {
            let limits = self.limits(k, axis, share);
            self.local.limit_skin(self.kernel, k, limits);
            if let Some(plane) = self.plane(k, axis, share) {
                if self.membranes[k].is_none() {
                    self.membranes[k] = self.crease(k, axis, plane).membrane(&self.local);
                }
                if let Some(membrane) = &mut self.membranes[k] {
                    membrane.relax(&mut self.local, &plane, passes);
                }
            }
        }
    }

    /// Planes for the lattice, which follows its skin.
    pub(super) fn separate(&mut self, axes: &[Axis], share: f32) {
        for (k, axis) in axes.iter().enumerate() {
            let limits = self.limits(k, axis, share);
            self.local.limit_nodes(self.kernel, k, limits);
        }
    }

    /// What the particles of joint `k` may not leave.
    pub(super) fn limits(&self, k: usize, axis: &Axis, share: f32) -> Limits {
        let most = if self.active[k].joint.is_limb { self.settings.bind as f32 } else { 0.0 };
        Limits::new(axis, self.plane(k, axis, share).as_ref(), most)
    }

    fn plane(&self, k: usize, axis: &Axis, share: f32) -> Option<HalfSpace> {
        if self.settings.self_collision { self.active[k].plane(axis, share) } else { None }
    }

    fn crease(&self, k: usize, axis: &Axis, plane: HalfSpace) -> Crease<'_> {
        let ActiveJoint { joint, swing, .. } = self.active[k];
        Crease { axis: *axis, plane, radius: joint.radius, swing, members: &self.local.region.free[k] }
    }

    /// Skin in contact when a joint has come all the way.
    pub(super) fn contacts(&self, k: usize, axis: &Axis) -> Vec<u32> {
        let Some(plane) = self.plane(k, axis, 1.0) else { return Vec::new() };
        self.crease(k, axis, plane).contacts(&self.local, IN_CONTACT * self.active[k].joint.radius)
    }
}
