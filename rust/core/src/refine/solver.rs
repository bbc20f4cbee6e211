//! One frame: the path from rest in sub-angles, each a few projections and a relaxed crease; then the volume.

use glam::{DAffine3, Vec3};

use super::clock::Clock;
use super::constraint::Axis;
use super::coupling::{carry_lattice, carry_skin, place};
use super::frame::{ActiveJoint, active_joints, posed_axis};
use super::local::Local;
use super::membrane::Membrane;
use super::pairs::Slabs;
use super::predictor::{follow, place_all, place_bound};
use super::prepared::{ARM, Prepared, TETRAHEDRON};
use super::projection::{Flesh, Kernel, Octahedra, PartOfStretch, Stretch, fill, project};
use super::report::Report;
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
/// Passes over the creases in each iteration.
const PASSES: usize = 2;
/// How far, in cells, skin that has come through skin is moved back.
pub(super) const FARTHEST: f32 = 1.5;

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
    pub(super) clock: Clock,
    pub(super) iterations: usize,
    pub(super) slabs: Slabs,
    /// Of every joint with skin in contact, for the iterations of one step.
    pub(super) membranes: Vec<Option<Membrane>>,
}

impl Frame<'_> {
    pub(super) fn axes(&self, pose: &[DAffine3]) -> Vec<Axis> {
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
                self.iterate(&axes, share as f32, quality == Quality::Bake && iteration == iterations);
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
        let (region, flesh) = (&local.region, flesh(settings));
        let stretch_compliance = (settings.stretch > 0.0).then(|| (1.0 / settings.stretch) as f32);
        if let Some(compliance) = stretch_compliance {
            let kind = PartOfStretch(compliance);
            project(kernel, kind, &region.edges, &mut local.of_edges, &mut local.particles);
        }
        let octahedra = Octahedra { flesh, stretch_compliance };
        project(kernel, octahedra, &region.octahedra, &mut local.of_octahedra, &mut local.particles);
        project(kernel, flesh, &region.loose, &mut local.of_loose, &mut local.particles);
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

    /// Surface vertices of the whole that this frame placed: free ones, and those bound near a limb's joint.
    fn moved(&self) -> Vec<(u32, Vec3)> {
        let surface = (self.local.nodes..self.local.particles.len()).map(|p| {
            let vertex = self.local.global[p] - self.prepared.node_count() as u32;
            (vertex, place(&self.local.particles[p]))
        });
        surface.collect()
    }
}
