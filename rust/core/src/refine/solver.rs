//! One frame: the path from rest in sub-angles, each a few projections and a relaxed crease; then the volume.

use std::time::Instant;

use glam::{DAffine3, Vec3};

use super::balloon::Balloon;
use super::constraint::{Axis, HalfSpace};
use super::contact::Suspects;
use super::coupling::{carry_lattice, carry_skin, place};
use super::crease::{Crease, within};
use super::frame::{ActiveJoint, active_joints, posed_axis};
use super::local::Local;
use super::membrane::Membrane;
use super::pairs::Slabs;
use super::predictor::{follow, linear, place_all, place_bound, skinned};
use super::prepared::{ARM, Prepared, TETRAHEDRON};
use super::projection::{Flesh, Kernel, Limits, Stretch, fill, project, untangle};
use super::report::{JointMeasure, JointReport, Report};
use super::settings::{Quality, Settings};
use super::skeleton::Path;

/// Most steps of a frame.
const MOST_STEPS: usize = 24;
/// What rounding may add to an angle, in steps: 120 degrees are four of 30.
const ROUNDING: f64 = 1e-3;
/// Iterations in all where something twists: dual quaternions pinch a wrist that only twists, whatever else bends a little.
const TWIST_ITERATIONS: usize = 10;
/// Twist from which that many are taken, radians.
const TWISTS: f64 = 0.5;
/// Share by which skin goes back to its place in the lattice in each iteration.
const REJOIN: f32 = 0.1;
/// Skin around a contact that the balloon leaves alone, in radii.
pub(super) const KEPT: f32 = 0.3;
/// Depth above the plane up to which skin counts as in contact for the balloon, in radii.
pub(super) const IN_CONTACT: f32 = 0.04;
/// Passes over the creases in each iteration.
const PASSES: usize = 2;
/// Times that tetrahedra turned inside out are looked for at the end.
const UNTANGLING: usize = 24;
/// Loss of a joint's volume from which it is asked whether skinning did better.
const HARM: f64 = 0.1;
/// How far, in cells, skin that has come through skin is moved back.
pub(super) const FARTHEST: f32 = 1.5;
/// What has moved by less, in cells, has stayed: rounding alone moves it by as much.
const STILL: f32 = 3e-5;

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
    /// Across which triangles are told apart.
    pub(super) slabs: Slabs,
}

/// How a frame is solved.
#[derive(Debug, Clone, Copy)]
pub(super) struct Work {
    pub(super) quality: Quality,
    pub(super) kernel: Kernel,
    pub(super) with_figures: bool,
}

/// Solves a pose (in cells). The answer depends on the pose alone, not on any earlier one. `skin` is where dual quaternions
/// have the mesh' vertices (mesh units).
pub(super) fn solve(
    prepared: &Prepared,
    settings: &Settings,
    pose: &[DAffine3],
    skin: &[[f32; 3]],
    Work { quality, kernel, with_figures }: Work,
) -> Solution {
    let mut clock = Clock::default();
    let path = Path::new(&prepared.skeleton, pose);
    let active = active_joints(&prepared.joints, &path, pose);
    if active.is_empty() {
        return Solution { moved: Vec::new(), report: Report::default(), slabs: Slabs::new([]) };
    }
    let local = clock.time("region", || Local::new(prepared.kept.region(prepared, &active)));
    let slabs = slabs(&active, pose);
    let membranes = active.iter().map(|_| None).collect();
    let mut frame =
        Frame { prepared, settings, active: &active, local, kernel, clock, iterations: 0, slabs, membranes };
    frame.walk(&path, quality);
    frame.finish(pose, skin, quality);
    let report = if with_figures { frame.report(&path, pose) } else { Report::default() };
    Solution { moved: frame.moved(), report, slabs: frame.slabs }
}

/// Across the planes of the joints that bend most.
fn slabs(active: &[ActiveJoint<'_>], pose: &[DAffine3]) -> Slabs {
    let mut limbs: Vec<&ActiveJoint<'_>> = active.iter().filter(|active| active.joint.is_limb).collect();
    limbs.sort_by(|a, b| b.swing.total_cmp(&a.swing));
    Slabs::new(limbs.iter().filter_map(|a| Some(a.plane(&posed_axis(a.joint, pose), 1.0)?.normal)))
}

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
        JointMeasure { bone: active[k].joint.bone, volume, bulge }
    };
    frame.axes(pose).iter().enumerate().map(of_joint).collect()
}

fn flesh(settings: &Settings) -> Flesh {
    let stiff = TETRAHEDRON.powf(4.0 / 3.0);
    let volume = (settings.volume > 0.0).then(|| (1.0 / settings.volume - 1.0) as f32 * stiff);
    let energy = (settings.energy > 0.0).then(|| (1.0 / settings.energy) as f32);
    Flesh { volume: TETRAHEDRON, arm: ARM, volume_compliance: volume, energy_compliance: energy }
}

pub(super) struct Frame<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) settings: &'a Settings,
    pub(super) active: &'a [ActiveJoint<'a>],
    pub(super) local: Local,
    pub(super) kernel: Kernel,
    clock: Clock,
    iterations: usize,
    slabs: Slabs,
    /// Of every joint with skin in contact, for the iterations of one step.
    membranes: Vec<Option<Membrane>>,
}

impl Frame<'_> {
    fn axes(&self, pose: &[DAffine3]) -> Vec<Axis> {
        self.active.iter().map(|active| posed_axis(active.joint, pose)).collect()
    }

    /// From rest to the pose.
    fn walk(&mut self, path: &Path<'_>, quality: Quality) {
        let swing = self.active.iter().map(|active| f64::from(active.swing)).fold(0.0, f64::max);
        let bends = swing > 1f64.to_radians();
        let steps =
            if bends { ((swing / quality.sub_angle() - ROUNDING).ceil() as usize).clamp(1, MOST_STEPS) } else { 1 };
        let twists = !bends || self.active.iter().any(|active| f64::from(active.twist) > TWISTS);
        let least = if twists { TWIST_ITERATIONS.div_ceil(steps) } else { 0 };
        let iterations = quality.iterations().max(least);
        let mut before = path.at(if bends { 0.0 } else { 1.0 });
        place_all(self.prepared, &mut self.local, &before);
        for step in 1..=steps {
            let share = step as f64 / steps as f64;
            let pose = path.at(share);
            let axes = self.axes(&pose);
            let mut clock = std::mem::take(&mut self.clock);
            clock.time("predict", || {
                follow(self.prepared, &mut self.local, &before, &pose);
                place_bound(&mut self.local, self.active, &axes);
            });
            self.clock = clock;
            self.local.restart();
            self.membranes.fill_with(|| None);
            for iteration in 1..=iterations {
                self.iterate(&axes, share as f32, quality == Quality::Bake || iteration == iterations);
            }
            before = pose;
        }
    }

    fn iterate(&mut self, axes: &[Axis], share: f32, untangles: bool) {
        let mut clock = std::mem::take(&mut self.clock);
        let nodes = self.local.nodes;
        let before = self.local.particles[..nodes].to_vec();
        clock.time("project", || self.project_lattice(untangles));
        clock.time("couple", || carry_skin(&mut self.local, &before, REJOIN));
        let skin = self.local.particles[nodes..].to_vec();
        clock.time("project", || self.project_surface());
        clock.time("crease", || self.limit(axes, share, PASSES));
        clock.time("couple", || carry_lattice(&mut self.local, &skin));
        clock.time("crease", || self.separate(axes, share));
        self.iterations += 1;
        self.clock = clock;
    }

    fn project_lattice(&mut self, untangles: bool) {
        let (settings, local, kernel) = (self.settings, &mut self.local, self.kernel);
        let region = &local.region;
        if settings.stretch > 0.0 {
            let kind = Stretch((1.0 / settings.stretch) as f32);
            project(kernel, kind, &region.edges, &mut local.of_edges, &mut local.particles);
        }
        let flesh = flesh(settings);
        if flesh.volume_compliance.is_some() || flesh.energy_compliance.is_some() {
            project(kernel, flesh, &region.tetrahedra, &mut local.of_tetrahedra, &mut local.particles);
        }
        if settings.volume > 0.0 && untangles {
            fill(kernel, &region.tetrahedra, TETRAHEDRON, &mut local.particles, [0.1, 0.3], 8);
        }
    }

    fn project_surface(&mut self) {
        if self.settings.stretch > 0.0 {
            let (kind, local) = (Stretch((1.0 / self.settings.stretch) as f32), &mut self.local);
            project(self.kernel, kind, &local.region.sides, &mut local.of_sides, &mut local.particles);
        }
    }

    /// Bind, planes and membranes of every joint.
    fn limit(&mut self, axes: &[Axis], share: f32, passes: usize) {
        for (k, axis) in axes.iter().enumerate() {
            let limits = self.limits(k, axis, share);
            self.local.limit_nodes(self.kernel, k, limits);
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

    /// Planes alone, which the lattice may have left when it followed its skin.
    fn separate(&mut self, axes: &[Axis], share: f32) {
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

    /// The last passes over the creases, and the volume.
    fn finish(&mut self, pose: &[DAffine3], skin: &[[f32; 3]], quality: Quality) {
        let axes = self.axes(pose);
        let mut clock = std::mem::take(&mut self.clock);
        self.membranes.fill_with(|| None);
        clock.time("crease", || self.limit(&axes, 1.0, quality.final_passes()));
        let suspects = match quality {
            Quality::Live => self.triangles_that_may_fold(),
            Quality::Bake => (0..self.local.triangles.len() as u32).collect(),
        };
        if self.settings.volume > 0.0 {
            clock.time("project", || {
                let local = &mut self.local;
                untangle(
                    self.kernel,
                    &local.region.tetrahedra,
                    TETRAHEDRON,
                    &mut local.particles,
                    [0.05, 0.2],
                    3,
                    UNTANGLING,
                );
            });
        }
        let (mut parted, mut left, mut lost, mut cleared) = (Vec::new(), 0, Vec::new(), Vec::new());
        // Planes leave few folds, and balloons none more. Hips have no planes: what parting costs there is restored.
        if self.active.iter().any(|active| !active.joint.is_limb) {
            (parted, left) = clock.time("contact", || self.part(&suspects, &[]));
            cleared = if left == 0 { self.places() } else { Vec::new() };
        }
        for _ in 0..quality.balloons() {
            lost = clock.time("balloon", || {
                let lost = (0..self.active.len()).map(|k| self.inflate(k, &axes[k], pose, &parted)).collect();
                self.inflate_whole(&axes, pose, skin, &parted);
                lost
            });
            let (more, pairs) = clock.time("contact", || self.part(&suspects, &cleared));
            left = pairs;
            let is_done = more.is_empty();
            parted.extend(more);
            if is_done {
                break;
            }
            // What does not move from here on is known to be clear of each other.
            cleared = if left == 0 { self.places() } else { Vec::new() };
        }
        if self.prepared.surface.islands > 1 && self.settings.self_collision {
            left = clock.time("contact", || self.pairs(&self.places()).len());
        }
        clock.time("contact", || self.undo_harm(pose, &axes, &lost, left));
        self.clock = clock;
    }

    /// Gives joints back to skinning where solving has done worse: on very coarse skin nothing is left of the inner side
    /// once it is pressed into the plane. `left` is the number of pairs of triangles that pass through each other.
    /// `missing` is the share of each joint's volume that balloons could not restore.
    fn undo_harm(&mut self, pose: &[DAffine3], axes: &[Axis], missing: &[f64], left: usize) {
        let all = 0..self.active.len();
        let lost =
            |frame: &Self, k: usize, places: &[Vec3]| frame.measure(k, pose, &axes[k], &|p| places[p as usize]).0;
        let may_harm = |&k: &usize| left > 0 || missing[k].is_nan() || missing[k].abs() > HARM / 2.0;
        let doubtful: Vec<usize> = all.clone().filter(may_harm).collect();
        if doubtful.is_empty() {
            return;
        }
        let solved = self.places();
        let suspects: Vec<usize> = doubtful.into_iter().filter(|&k| lost(self, k, &solved).abs() > HARM).collect();
        if suspects.is_empty() && left == 0 {
            return;
        }
        let skins = [skinned, linear].map(|skin| skin(self.prepared, &self.local.region, pose));
        let totals = skins.each_ref().map(|skin| self.pairs(skin).len());
        let skin = &skins[usize::from(totals[1] < totals[0])];
        for k in suspects {
            if lost(self, k, &solved).abs() > lost(self, k, skin).abs() + HARM / 2.0 {
                self.give_back(k, skin);
            }
        }
        let most = totals[0].min(totals[1]);
        let mut left = self.pairs(&self.places());
        for k in all.clone() {
            if left.len() <= most {
                return;
            }
            let before = self.local.particles.clone();
            self.give_back(k, skin);
            let now = self.pairs(&self.places());
            if now.len() < left.len() {
                left = now;
            } else {
                self.local.particles = before;
            }
        }
        if left.len() > most {
            all.for_each(|k| self.give_back(k, skin));
        }
    }

    fn places(&self) -> Vec<Vec3> {
        self.local.particles.iter().map(place).collect()
    }

    /// The pairs of the region's triangles that pass through each other, but for those that do at rest.
    fn pairs(&self, places: &[Vec3]) -> Vec<[u32; 2]> {
        self.prepared.contact.all_pairs(&*self.local.region, places, &self.slabs)
    }

    /// Puts a joint's skin where skinning has it.
    fn give_back(&mut self, k: usize, skin: &[Vec3]) {
        let Local { region, particles, .. } = &mut self.local;
        for member in region.free[k].iter().chain(&region.beyond[k]) {
            let particle = &mut particles[member.particle as usize];
            [particle[0], particle[1], particle[2]] = skin[member.particle as usize].to_array();
        }
    }

    /// The triangles that may fold: those of the membranes, and all of joints that have none.
    fn triangles_that_may_fold(&self) -> Vec<u32> {
        let mut may_fold = vec![false; self.local.particles.len()];
        let bare = self.active.iter().zip(&self.local.free).filter(|(active, _)| !active.joint.is_limb);
        let membranes = self.membranes.iter().flatten().flat_map(Membrane::vertices).copied();
        let particles = bare.flat_map(|(_, members)| members).map(|member| member.particle).chain(membranes);
        particles.for_each(|p| may_fold[p as usize] = true);
        let count = self.local.triangles.len() as u32;
        (0..count).filter(|&t| self.local.triangles[t as usize].iter().any(|&p| may_fold[p as usize])).collect()
    }

    /// Takes out what folds are left in the region's skin; returns the particles that moved, and how many pairs remain.
    /// `cleared` are places at which no triangles of the region intersected, if there are any.
    fn part(&mut self, suspects: &[u32], cleared: &[Vec3]) -> (Vec<u32>, usize) {
        if !self.settings.self_collision {
            return (Vec::new(), 0);
        }
        let (mut places, region) = (self.places(), &*self.local.region);
        let stays: Vec<bool> = cleared.iter().zip(&places).map(|(a, b)| (a - b).abs().max_element() < STILL).collect();
        let is_cleared = |t: u32| !stays.is_empty() && region.triangles[t as usize].iter().all(|&p| stays[p as usize]);
        let among = Suspects { triangles: suspects, cleared: &is_cleared };
        let (moved, left) = self.prepared.contact.part(region, &mut places, among, FARTHEST, &self.slabs);
        for &p in &moved {
            let particle = &mut self.local.particles[p as usize];
            [particle[0], particle[1], particle[2]] = places[p as usize].to_array();
        }
        (moved, left)
    }

    /// Restores the volume about a limb's joint; returns the share that is missing then. Elsewhere the ends of the region
    /// hardly move rigidly about it, so that the body's whole volume decides if it is known; beside a chest not at all.
    fn inflate(&mut self, k: usize, axis: &Axis, pose: &[DAffine3], parted: &[u32]) -> f64 {
        let joint = self.active[k].joint;
        let is_measured = joint.is_limb || joint.is_slim && !self.has_whole(pose);
        if self.settings.volume == 0.0 || !is_measured {
            return f64::NAN;
        }
        let mut contacts = self.contacts(k, axis);
        contacts.extend(parted);
        let kept = within(&self.local, &contacts, KEPT * joint.radius);
        let balloon = Balloon::new(&self.local, &self.local.region.free[k], &kept);
        let target = self.rest_volume(&balloon, k) * self.growth(k, pose);
        let (kernel, limits) = (self.kernel, self.limits(k, axis, 1.0));
        let missing = balloon.inflate(&mut self.local, axis.origin, target, joint.radius, |local| {
            local.limit_skin(kernel, k, limits);
        });
        if target == 0.0 { 0.0 } else { missing / target }
    }

    fn rest_volume(&self, balloon: &Balloon, k: usize) -> f64 {
        let rest = |p: u32| self.prepared.rest[self.local.global[p as usize] as usize];
        let volume = || balloon.volume(self.active[k].joint.axis.origin, rest);
        *self.local.region.rest_volumes[k].get_or_init(volume)
    }

    /// By how much the bones' own scale changes the joint's volume.
    pub(super) fn growth(&self, k: usize, pose: &[DAffine3]) -> f64 {
        let joint = self.active[k].joint;
        (pose[joint.parent].matrix3.determinant() + pose[joint.bone].matrix3.determinant()) / 2.0
    }

    fn report(&mut self, path: &Path<'_>, pose: &[DAffine3]) -> Report {
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
    fn measure(&self, k: usize, pose: &[DAffine3], axis: &Axis, at: &(dyn Fn(u32) -> Vec3 + Sync)) -> (f64, f64) {
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

    /// Surface vertices of the whole that this frame placed: free ones, and those bound near a limb's joint.
    fn moved(&self) -> Vec<(u32, Vec3)> {
        let surface = (self.local.nodes..self.local.particles.len()).map(|p| {
            let vertex = self.local.global[p] - self.prepared.node_count() as u32;
            (vertex, place(&self.local.particles[p]))
        });
        surface.collect()
    }
}
