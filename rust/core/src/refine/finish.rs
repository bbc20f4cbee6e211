//! The end of a frame's way: last passes over the creases, folds and the volume.

use glam::{DAffine3, Vec3};

use super::balloon::Balloon;
use super::constraint::Axis;
use super::contact::Effort;
use super::crease::within;
use super::membrane::Membrane;
use super::pairs::Suspects;
use super::prepared::TETRAHEDRON;
use super::projection::untangle;
use super::settings::Quality;
use super::solver::{FARTHEST, Frame, KEPT, Work};

/// Times that tetrahedra turned inside out are looked for at the end.
const UNTANGLING: usize = 24;
/// What has moved by less, in cells, has stayed: rounding alone moves it by as much.
const STILL: f32 = 3e-5;

impl Frame<'_> {
    /// The last passes over the creases, and the volume.
    pub(super) fn finish(&mut self, pose: &[DAffine3], skin: &[[f32; 3]], Work { quality, with_figures, .. }: Work) {
        let axes = self.axes(pose);
        let mut clock = std::mem::take(&mut self.clock);
        self.membranes.fill_with(|| None);
        clock.time("crease", || self.limit(&axes, 1.0, quality.final_passes()));
        let suspects = match quality {
            Quality::Live => self.triangles_that_may_fold(),
            Quality::Bake => (0..self.local.triangles.len() as u32).collect(),
        };
        if with_figures {
            clock.time("untangle", || self.untangle());
        }
        let (mut parted, mut left, mut lost, mut cleared) = (Vec::new(), 0, Vec::new(), Vec::new());
        // Planes leave few folds, and balloons none more. Hips have no planes: what parting costs there is restored.
        if self.active.iter().any(|active| !active.joint.is_limb) {
            (parted, left) = clock.time("contact", || self.part(&suspects, &[], quality));
            cleared = if left == 0 { self.places() } else { Vec::new() };
        }
        for _ in 0..quality.balloons() {
            lost = clock.time("balloon", || {
                let lost = (0..self.active.len()).map(|k| self.inflate(k, &axes[k], pose, &parted)).collect();
                self.inflate_whole(&axes, pose, skin, &parted);
                lost
            });
            let (more, pairs) = clock.time("contact", || self.part(&suspects, &cleared, quality));
            left = pairs;
            let is_done = more.is_empty();
            parted.extend(more);
            if is_done {
                break;
            }
            // What does not move from here on is known to be clear of each other.
            cleared = if left == 0 { self.places() } else { Vec::new() };
        }
        clock.time("contact", || {
            if self.undo_harm(pose, &axes, &lost, left) {
                left = self.part(&suspects, &[], quality).1;
            }
            self.unfold(pose, left);
        });
        self.clock = clock;
    }

    /// Puts right what tetrahedra the path has left inside out. No skin follows the lattice any more then, so that a frame of
    /// which only the skin is wanted does without.
    fn untangle(&mut self) {
        if self.settings.volume > 0.0 {
            let (tetrahedra, particles) = (&self.local.region.tetrahedra, &mut self.local.particles);
            untangle(self.kernel, tetrahedra, TETRAHEDRON, particles, [0.05, 0.2], 3, UNTANGLING);
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
    fn part(&mut self, suspects: &[u32], cleared: &[Vec3], quality: Quality) -> (Vec<u32>, usize) {
        if !self.settings.self_collision {
            return (Vec::new(), 0);
        }
        let (mut places, region) = (self.places(), &*self.local.region);
        let stays: Vec<bool> = cleared.iter().zip(&places).map(|(a, b)| (a - b).abs().max_element() < STILL).collect();
        let is_cleared = |t: u32| !stays.is_empty() && region.triangles[t as usize].iter().all(|&p| stays[p as usize]);
        let among = Suspects { cleared: &is_cleared, ..Suspects::all_of(suspects) };
        let effort = Effort { farthest: FARTHEST, rounds: quality.rounds() };
        let (moved, left) = self.prepared.contact.part(region, &mut places, among, effort, &self.slabs);
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
        if self.settings.volume == 0.0 || !self.is_measured(k, pose) {
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

    /// Whether the volume about a joint means something.
    pub(super) fn is_measured(&self, k: usize, pose: &[DAffine3]) -> bool {
        let joint = self.active[k].joint;
        joint.is_limb || joint.is_slim && !self.has_whole(pose)
    }

    pub(super) fn rest_volume(&self, balloon: &Balloon, k: usize) -> f64 {
        let rest = |p: u32| self.prepared.rest[self.local.global[p as usize] as usize];
        let volume = || balloon.volume(self.active[k].joint.axis.origin, rest);
        *self.local.region.rest_volumes[k].get_or_init(volume)
    }

    /// By how much the bones' own scale changes the joint's volume.
    pub(super) fn growth(&self, k: usize, pose: &[DAffine3]) -> f64 {
        let joint = self.active[k].joint;
        (pose[joint.parent].matrix3.determinant() + pose[joint.bone].matrix3.determinant()) / 2.0
    }
}
