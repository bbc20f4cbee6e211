//! One frame: the path from rest in sub-angles, each a few projections and a relaxed crease; then the volume.

use std::time::Instant;

use glam::{DAffine3, Vec3};

use super::balloon::Balloon;
use super::constraint::Axis;
use super::coupling::{carry_lattice, carry_skin, place, rejoin};
use super::crease::{Crease, bind_skin, within};
use super::frame::{ActiveJoint, active_joints, posed_axis};
use super::local::Local;
use super::predictor::{follow, place_bound, skinned};
use super::prepared::Prepared;
use super::projection::{Energy, Kernel, Stretch, Volume, project};
use super::report::{JointReport, Report};
use super::settings::{Quality, Settings};
use super::skeleton::Path;

/// Most steps of a frame.
const MOST_STEPS: usize = 24;
/// Iterations where nothing bends: twist alone, from dual quaternions.
const TWIST_ITERATIONS: usize = 10;
/// Share by which skin goes back to its place in the lattice in each iteration.
const REJOIN: f32 = 0.1;
/// Skin around a contact that the balloon leaves alone, in radii.
const KEPT: f32 = 0.3;

/// Times of the stages, by name, in the order they first ran.
#[derive(Default)]
pub(super) struct Clock(Vec<(&'static str, f64)>);

impl Clock {
    pub(super) fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        match self.0.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((stage, ms)),
        }
        result
    }
}

/// What a frame's solution is made of.
pub(super) struct Solution {
    /// Surface vertices that the solver moved, and their places in cells.
    pub(super) moved: Vec<(u32, Vec3)>,
    pub(super) report: Report,
}

/// Solves a pose (in cells). The answer depends on the pose alone, not on any earlier one.
pub(super) fn solve(
    prepared: &Prepared,
    settings: &Settings,
    pose: &[DAffine3],
    quality: Quality,
    kernel: Kernel,
) -> Solution {
    let mut clock = Clock::default();
    let path = Path::new(&prepared.skeleton, pose);
    let active = active_joints(&prepared.joints, &path, pose);
    if active.is_empty() {
        return Solution { moved: Vec::new(), report: Report::default() };
    }
    let local = clock.time("region", || Local::new(prepared, &active));
    let mut frame = Frame { prepared, settings, active: &active, local, kernel, clock, iterations: 0 };
    frame.walk(&path, quality);
    frame.finish(pose, quality);
    let report = frame.report(&path, pose);
    Solution { moved: frame.moved(), report }
}

struct Frame<'a> {
    prepared: &'a Prepared,
    settings: &'a Settings,
    active: &'a [ActiveJoint<'a>],
    local: Local,
    kernel: Kernel,
    clock: Clock,
    iterations: usize,
}

impl Frame<'_> {
    fn axes(&self, pose: &[DAffine3]) -> Vec<Axis> {
        self.active.iter().map(|active| posed_axis(active.joint, pose)).collect()
    }

    /// From rest to the pose.
    fn walk(&mut self, path: &Path<'_>, quality: Quality) {
        let swing = self.active.iter().map(|active| f64::from(active.swing)).fold(0.0, f64::max);
        let bends = swing > 1f64.to_radians();
        let steps = if bends { ((swing / quality.sub_angle()).ceil() as usize).clamp(1, MOST_STEPS) } else { 1 };
        let iterations = if bends { quality.iterations() } else { TWIST_ITERATIONS };
        let mut before = path.at(if bends { 0.0 } else { 1.0 });
        let start = skinned(self.prepared, &self.local, &before);
        for (particle, place) in self.local.particles.iter_mut().zip(&start) {
            [particle[0], particle[1], particle[2]] = place.to_array();
        }
        for step in 1..=steps {
            let share = step as f64 / steps as f64;
            let pose = path.at(share);
            let axes = self.axes(&pose);
            let mut clock = std::mem::take(&mut self.clock);
            clock.time("predict", || {
                let skin = skinned(self.prepared, &self.local, &pose);
                follow(self.prepared, &mut self.local, &before, &pose);
                place_bound(&mut self.local, &skin, self.active, &axes);
            });
            self.clock = clock;
            self.restart();
            for _ in 0..iterations {
                self.iterate(&axes, share as f32);
            }
            before = pose;
        }
    }

    fn restart(&mut self) {
        self.local.lattice_stretch.restart();
        self.local.surface_stretch.restart();
        self.local.volume.restart();
        self.local.energy.restart();
    }

    fn iterate(&mut self, axes: &[Axis], share: f32) {
        let mut clock = std::mem::take(&mut self.clock);
        let nodes = self.local.nodes;
        let before = self.local.particles[..nodes].to_vec();
        clock.time("project", || self.project_lattice());
        clock.time("couple", || {
            carry_skin(&mut self.local, &before);
            rejoin(&mut self.local, REJOIN);
        });
        let skin = self.local.particles[nodes..].to_vec();
        clock.time("project", || self.project_surface());
        clock.time("crease", || self.limit(axes, share, 2));
        clock.time("couple", || carry_lattice(&mut self.local, &skin));
        clock.time("crease", || self.separate(axes, share));
        self.iterations += 1;
        self.clock = clock;
    }

    fn project_lattice(&mut self) {
        let (settings, local, kernel) = (self.settings, &mut self.local, self.kernel);
        if settings.stretch > 0.0 {
            let kind = Stretch((1.0 / settings.stretch) as f32);
            project(kernel, kind, &mut local.lattice_stretch, &mut local.particles);
        }
        if settings.volume > 0.0 {
            let kind = Volume((1.0 / settings.volume - 1.0) as f32);
            project(kernel, kind, &mut local.volume, &mut local.particles);
        }
        if settings.energy > 0.0 {
            let kind = Energy((1.0 / settings.energy) as f32);
            project(kernel, kind, &mut local.energy, &mut local.particles);
        }
    }

    fn project_surface(&mut self) {
        if self.settings.stretch > 0.0 {
            let kind = Stretch((1.0 / self.settings.stretch) as f32);
            project(self.kernel, kind, &mut self.local.surface_stretch, &mut self.local.particles);
        }
    }

    /// Bind, planes and membranes of every joint.
    fn limit(&mut self, axes: &[Axis], share: f32, passes: usize) {
        for (k, active) in self.active.iter().enumerate() {
            let members = std::mem::take(&mut self.local.free[k]);
            if self.settings.bind > 0.0 && active.joint.is_limb {
                bind_skin(&mut self.local, &axes[k], &members, self.settings.bind as f32);
            }
            if let Some(crease) = self.crease(k, &axes[k], share, &members) {
                crease.separate(&mut self.local);
                crease.relax(&mut self.local, &self.prepared.rest, passes);
            }
            self.local.free[k] = members;
        }
    }

    /// Planes alone.
    fn separate(&mut self, axes: &[Axis], share: f32) {
        for k in 0..self.active.len() {
            let members = std::mem::take(&mut self.local.free[k]);
            if let Some(crease) = self.crease(k, &axes[k], share, &members) {
                crease.separate(&mut self.local);
            }
            self.local.free[k] = members;
        }
    }

    fn crease<'m>(
        &self,
        k: usize,
        axis: &Axis,
        share: f32,
        members: &'m [super::joints::Member],
    ) -> Option<Crease<'m>> {
        if !self.settings.self_collision {
            return None;
        }
        let plane = self.active[k].plane(axis, share)?;
        Some(Crease { axis: *axis, plane, radius: self.active[k].joint.radius, members })
    }

    /// The last passes over the creases, and the volume.
    fn finish(&mut self, pose: &[DAffine3], quality: Quality) {
        let axes = self.axes(pose);
        let mut clock = std::mem::take(&mut self.clock);
        clock.time("crease", || self.limit(&axes, 1.0, quality.final_passes()));
        if self.settings.volume > 0.0 {
            clock.time("balloon", || {
                (0..self.active.len()).for_each(|k| self.inflate(k, &axes[k], pose));
            });
        }
        self.clock = clock;
    }

    fn inflate(&mut self, k: usize, axis: &Axis, pose: &[DAffine3]) {
        let members = std::mem::take(&mut self.local.free[k]);
        let joint = self.active[k].joint;
        let crease = self.crease(k, axis, 1.0, &members);
        let contacts = crease.map(|crease| crease.contacts(&self.local, 0.04 * joint.radius)).unwrap_or_default();
        let kept = within(&self.local, &self.prepared.rest, &contacts, KEPT * joint.radius);
        let balloon = Balloon::new(&self.local, &members, &kept);
        let target = self.rest_volume(&balloon, k) * self.growth(k, pose);
        let most = if joint.is_limb { self.settings.bind as f32 } else { 0.0 };
        balloon.inflate(&mut self.local, axis.origin, target, joint.radius, |local| {
            if most > 0.0 {
                bind_skin(local, axis, &members, most);
            }
            if let Some(crease) = crease {
                crease.separate(local);
            }
        });
        self.local.free[k] = members;
    }

    fn rest_volume(&self, balloon: &Balloon, k: usize) -> f64 {
        let rest = |p: u32| self.prepared.rest[self.local.global[p as usize] as usize];
        balloon.volume(self.active[k].joint.axis.origin, rest)
    }

    /// By how much the bones' own scale changes the joint's volume.
    fn growth(&self, k: usize, pose: &[DAffine3]) -> f64 {
        let joint = self.active[k].joint;
        (pose[joint.parent].matrix3.determinant() + pose[joint.bone].matrix3.determinant()) / 2.0
    }

    fn report(&mut self, path: &Path<'_>, pose: &[DAffine3]) -> Report {
        let axes = self.axes(pose);
        let before = skinned(self.prepared, &self.local, pose);
        let joints = (0..self.active.len()).map(|k| self.joint_report(k, path, pose, &axes[k], &before)).collect();
        let local = &self.local;
        let constraints = [
            local.lattice_stretch.len() + local.surface_stretch.len(),
            local.volume.len(),
            local.energy.len(),
            local.free.iter().map(Vec::len).sum(),
        ];
        Report {
            joints,
            active_tetrahedra: local.volume.len(),
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

    fn joint_report(&self, k: usize, path: &Path<'_>, pose: &[DAffine3], axis: &Axis, before: &[Vec3]) -> JointReport {
        let (joint, members) = (self.active[k].joint, &self.local.free[k]);
        let balloon = Balloon::new(&self.local, members, &[]);
        let target = self.rest_volume(&balloon, k) * self.growth(k, pose);
        let after = |p: u32| place(&self.local.particles[p as usize]);
        let before = |p: u32| before[p as usize];
        let share = |volume: f64| if target == 0.0 { 0.0 } else { volume / target - 1.0 };
        let skin = || members.iter().filter(|m| self.local.is_surface(m.particle) && m.distance > 0.2 * joint.radius);
        let bulge = |at: &dyn Fn(u32) -> Vec3| {
            skin().map(|m| f64::from(axis.offset(at(m.particle)).length() / m.distance)).fold(0.0, f64::max)
        };
        JointReport {
            bone: joint.bone,
            angle: path.angle(joint.bone),
            volume_before: share(balloon.volume(axis.origin, before)),
            volume_after: share(balloon.volume(axis.origin, after)),
            bulge_before: bulge(&before),
            bulge_after: bulge(&after),
            is_limb: joint.is_limb,
        }
    }

    /// Surface vertices of the whole that this frame placed: free ones, and those bound near a limb's joint.
    fn moved(&self) -> Vec<(u32, Vec3)> {
        let surface = (self.local.nodes..self.local.particles.len()).map(|p| {
            let vertex = self.local.global[p] - self.prepared.node_count() as u32;
            (vertex, place(&self.local.particles[p]))
        });
        surface.collect()
    }
}
