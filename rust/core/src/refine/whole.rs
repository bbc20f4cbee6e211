//! The volume of the whole body, where hips and shoulders meet: the ends of their regions do not move rigidly, so that what
//! each of them is measured to enclose misses what is lost between them.

use glam::{DAffine3, DVec3, Vec3};

use super::balloon::Balloon;
use super::constraint::Axis;
use super::coupling::place;
use super::crease::within;
use super::joints::Member;
use super::solver::{Frame, KEPT};

/// Share of a component's volume that may be missing.
const TOLERATED: f64 = 0.01;
/// Most that is restored, as a share of the body's volume.
const MOST: f64 = 0.05;
/// And as a share of the component's own: a ball in a finger's joint would burst otherwise.
const MOST_OF_OWN: f64 = 0.1;
/// Bones that change a joint's volume by more than this scale the body, and its volume is not that of rest.
const RIGID: f64 = 1e-3;

impl Frame<'_> {
    /// Restores what is missing of the components' volumes beyond a tolerated share, at the joints that are no limbs. `skin`
    /// is where dual quaternions have the mesh' vertices (mesh units).
    pub(super) fn inflate_whole(&mut self, axes: &[Axis], pose: &[DAffine3], skin: &[[f32; 3]], parted: &[u32]) {
        let trunk: Vec<usize> = (0..self.active.len()).filter(|&k| !self.active[k].joint.is_limb).collect();
        if self.settings.volume == 0.0 || trunk.is_empty() || !self.has_whole(pose) {
            return;
        }
        let excess = self.excess(skin);
        if excess.iter().all(|&excess| excess == 0.0) {
            return;
        }
        let (members, kept) = (self.members(&trunk), self.kept(axes, parted));
        for (island, &excess) in excess.iter().enumerate().filter(|&(_, &excess)| excess != 0.0) {
            let is_here = |member: &&Member| self.island(member.particle) == Some(island);
            let members: Vec<Member> = members.iter().filter(is_here).copied().collect();
            if !members.is_empty() {
                let balloon = Balloon::new(&self.local, &members, &kept);
                self.inflate_by(&balloon, 6.0 * excess, axes, trunk[0]);
            }
        }
    }

    /// Six times the volume is `more` afterwards; limbs keep their limits.
    fn inflate_by(&mut self, balloon: &Balloon, more: f64, axes: &[Axis], trunk: usize) {
        let (apex, radius, kernel) = (axes[trunk].origin, self.active[trunk].joint.radius, self.kernel);
        let target = balloon.volume(apex, |p| place(&self.local.particles[p as usize])) + more;
        let limbs = (0..self.active.len()).filter(|&k| self.active[k].joint.is_limb);
        let limits: Vec<_> = limbs.map(|k| (k, self.limits(k, &axes[k], 1.0))).collect();
        balloon.inflate(&mut self.local, apex, target, radius, |local| {
            limits.iter().for_each(|&(k, limits)| local.limit_skin(kernel, k, limits));
        });
    }

    /// The connected component of a particle of the skin.
    fn island(&self, particle: u32) -> Option<usize> {
        let vertex = (self.local.global[particle as usize] as usize).checked_sub(self.prepared.node_count())?;
        Some(self.prepared.surface.island[vertex] as usize)
    }

    /// Whether the body's volume is known, and that of rest.
    pub(super) fn has_whole(&self, pose: &[DAffine3]) -> bool {
        let is_rigid = |k: usize| (self.growth(k, pose) - 1.0).abs() < RIGID;
        self.prepared.surface.is_mostly_solid && (0..self.active.len()).all(is_rigid)
    }

    /// The volume that is to be restored to each component of the skin, in cells.
    fn excess(&self, skin: &[[f32; 3]]) -> Vec<f64> {
        let missing = self.missing(skin);
        let all: f64 = missing.iter().map(|(_, whole)| whole.abs()).sum();
        let excess = |&(missing, whole): &(f64, f64)| {
            let (tolerated, most) = (TOLERATED * whole.abs(), (MOST * all).min(MOST_OF_OWN * whole.abs()));
            (missing - missing.clamp(-tolerated, tolerated)).clamp(-most, most)
        };
        missing.iter().map(excess).collect()
    }

    /// The volume that each component of the skin misses, in cells, and all of it at rest.
    fn missing(&self, skin: &[[f32; 3]]) -> Vec<(f64, f64)> {
        let (prepared, surface) = (self.prepared, &self.prepared.surface);
        let in_cells = |&i: &u32| (Vec3::from(skin[i as usize]).as_dvec3() - prepared.middle) / prepared.cell;
        let mut places: Vec<DVec3> = surface.source.iter().map(in_cells).collect();
        for p in self.local.nodes..self.local.particles.len() {
            let vertex = self.local.global[p] as usize - prepared.node_count();
            places[vertex] = place(&self.local.particles[p]).as_dvec3();
        }
        let at_rest = |i: u32| prepared.rest[prepared.node_count() + i as usize].as_dvec3();
        let now = surface.volumes(|i| places[i as usize]);
        surface.volumes(at_rest).into_iter().zip(now).map(|(whole, now)| (whole - now, whole)).collect()
    }

    /// The free members of some joints, each particle once, ascending.
    fn members(&self, joints: &[usize]) -> Vec<Member> {
        let mut members: Vec<Member> = joints.iter().flat_map(|&k| self.local.free[k].iter().copied()).collect();
        members.sort_by_key(|member| member.particle);
        members.dedup_by_key(|member| member.particle);
        members
    }

    /// Skin in contact and near it, which stays.
    fn kept(&self, axes: &[Axis], parted: &[u32]) -> Vec<u32> {
        let mut kept = Vec::new();
        for (k, axis) in axes.iter().enumerate() {
            let radius = self.active[k].joint.radius;
            kept.extend(within(&self.local, &self.contacts(k, axis), KEPT * radius));
        }
        let radius = self.active.iter().map(|active| active.joint.radius).fold(f32::INFINITY, f32::min);
        kept.extend(within(&self.local, parted, KEPT * radius));
        kept
    }
}
