//! Figures of a solved frame.

use glam::{DAffine3, Vec3};

use super::balloon::Balloon;
use super::clock::Clock;
use super::constraint::Axis;
use super::coupling::place;
use super::frame::active_joints;
use super::local::Local;
use super::pairs::Slabs;
use super::predictor::skinned;
use super::prepared::Prepared;
use super::projection::Kernel;
use super::report::{JointMeasure, JointReport, Report};
use super::settings::Settings;
use super::skeleton::Path;
use super::solver::Frame;

/// Volume and bulge of every active joint for skin at given places (welded surface vertices, in cells).
pub(super) fn measure(
    prepared: &Prepared,
    settings: &Settings,
    pose: &[DAffine3],
    places: &[Vec3],
) -> Vec<JointMeasure> {
    let path = Path::new(&prepared.skeleton, pose);
    let active = active_joints(&prepared.joints, &path, pose);
    let local = Local::new(prepared.kept.region(prepared, &active));
    let (kernel, clock) = (Kernel::Lanes, Clock::default());
    let (slabs, membranes) = (Slabs::new([]), Vec::new());
    let frame = Frame { prepared, settings, active: &active, local, kernel, clock, iterations: 0, slabs, membranes };
    let at = |p: u32| places[frame.local.global[p as usize] as usize - prepared.node_count()];
    let of_joint = |(k, axis): (usize, &Axis)| {
        let (volume, bulge) = frame.measure(k, pose, axis, &at);
        let joint = active[k].joint;
        JointMeasure { bone: joint.bone, volume: joint.is_slim.then_some(volume), bulge }
    };
    frame.axes(pose).iter().enumerate().map(of_joint).collect()
}

impl Frame<'_> {
    pub(super) fn report(&mut self, path: &Path<'_>, pose: &[DAffine3]) -> Report {
        let axes = self.axes(pose);
        let before = skinned(self.prepared, &self.local, pose);
        let joints = (0..self.active.len()).map(|k| self.joint_report(k, path, pose, &axes[k], &before)).collect();
        let local = &self.local;
        let constraints =
            [local.edges.len() + local.sides.len(), local.tetrahedra.len() * 2, local.free.iter().map(Vec::len).sum()];
        Report {
            joints,
            active_tetrahedra: local.tetrahedra.len(),
            inverted_tetrahedra: local.inverted(),
            constraints: constraints.iter().sum(),
            iterations: self.iterations,
            tetrahedra: self.prepared.lattice.tetrahedra.len(),
            cloned_tetrahedra: self.prepared.lattice.cloned,
            nodes: self.prepared.node_count(),
            stages: std::mem::take(&mut self.clock.0),
            ..Report::default()
        }
    }

    /// Volume of a joint's region against rest, and the farthest that its skin is from the bones against rest.
    pub(super) fn measure(
        &self,
        k: usize,
        pose: &[DAffine3],
        axis: &Axis,
        at: &(dyn Fn(u32) -> Vec3 + Sync),
    ) -> (f64, f64) {
        let (joint, members) = (self.active[k].joint, &self.local.free[k]);
        let balloon = Balloon::still(&self.local, members);
        let target = self.rest_volume(&balloon, k) * self.growth(k, pose);
        let volume = balloon.volume(axis.origin, at);
        let skin = members.iter().filter(|m| self.local.is_surface(m.particle) && m.distance > 0.2 * joint.radius);
        let bulge = skin.map(|m| f64::from(axis.offset(at(m.particle)).length() / m.distance)).fold(0.0, f64::max);
        (if target == 0.0 { 0.0 } else { volume / target - 1.0 }, bulge)
    }

    fn joint_report(&self, k: usize, path: &Path<'_>, pose: &[DAffine3], axis: &Axis, before: &[Vec3]) -> JointReport {
        let joint = self.active[k].joint;
        let (volume_before, bulge_before) = self.measure(k, pose, axis, &|p| before[p as usize]);
        let (volume_after, bulge_after) = self.measure(k, pose, axis, &|p| place(&self.local.particles[p as usize]));
        let (angle, is_limb) = (path.angle(joint.bone), joint.is_limb);
        JointReport { bone: joint.bone, angle, volume_before, volume_after, bulge_before, bulge_after, is_limb }
    }
}
