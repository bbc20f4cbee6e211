//! Where particles go with the bones: the start of every step, and the place of what the solver leaves to the skeleton.

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::constraint::{Axis, bind};
use super::frame::ActiveJoint;
use super::local::Local;
use super::prepared::Prepared;
use super::region::Region;
use crate::skinning::{DualQuaternion, blended_position};

/// Particles that one task moves.
const RUN: usize = 512;

fn motions(pose: &[DAffine3]) -> Vec<DualQuaternion> {
    pose.iter().map(|m| DualQuaternion::new(m, &DAffine3::IDENTITY)).collect()
}

/// The posed place of every local particle by dual quaternions.
pub(super) fn skinned(prepared: &Prepared, region: &Region, pose: &[DAffine3]) -> Vec<Vec3> {
    let motions = motions(pose);
    let posed = |&p: &u32| {
        let (bones, values) = prepared.weights.row(p as usize);
        blended_position(prepared.rest[p as usize].as_dvec3(), bones, values, &motions).as_vec3()
    };
    region.global.par_iter().with_min_len(RUN).map(posed).collect()
}

/// The same by linear blending.
pub(super) fn linear(prepared: &Prepared, region: &Region, pose: &[DAffine3]) -> Vec<Vec3> {
    let posed = |&p: &u32| {
        let (bones, values) = prepared.weights.row(p as usize);
        let rest = prepared.rest[p as usize].as_dvec3();
        let moved = |(&bone, &value): (&u32, &f32)| f64::from(value) * pose[bone as usize].transform_point3(rest);
        if bones.is_empty() { rest.as_vec3() } else { bones.iter().zip(values).map(moved).sum::<DVec3>().as_vec3() }
    };
    region.global.par_iter().with_min_len(RUN).map(posed).collect()
}

/// Puts all particles where dual quaternions say.
pub(super) fn place_all(prepared: &Prepared, local: &mut Local, pose: &[DAffine3]) {
    for (particle, place) in local.particles.iter_mut().zip(skinned(prepared, &local.region, pose)) {
        [particle[0], particle[1], particle[2]] = place.to_array();
    }
}

/// Puts skin near a joint that is not free about as far from the bones as at rest, as the weights' long tails would swell
/// and thin the limb there.
pub(super) fn place_bound(local: &mut Local, active: &[ActiveJoint<'_>], axes: &[Axis]) {
    let Local { region, particles, .. } = local;
    for ((joint, axis), members) in active.iter().zip(axes).zip(&region.beyond) {
        for member in members.iter().filter(|_| joint.joint.is_limb) {
            let particle = &mut particles[member.particle as usize];
            let place = Vec3::new(particle[0], particle[1], particle[2]);
            if particle[3] == 0.0 {
                let (nearest, farthest) = joint.bounds_beyond(member);
                let place = place + bind(axis, place, nearest, farthest);
                [particle[0], particle[1], particle[2]] = place.to_array();
            }
        }
    }
}

/// Moves free particles by what the bones did since the last step, and puts the others where dual quaternions say.
pub(super) fn follow(prepared: &Prepared, local: &mut Local, before: &[DAffine3], after: &[DAffine3]) {
    let changes: Vec<DAffine3> = before.iter().zip(after).map(|(b, a)| *a * b.inverse()).collect();
    let (changes, whole) = (motions(&changes), motions(after));
    let moved = |(particle, &p): (&mut [f32; 4], &u32)| {
        let (bones, values) = prepared.weights.row(p as usize);
        let (from, motions) = if particle[3] > 0.0 {
            (Vec3::new(particle[0], particle[1], particle[2]), &changes)
        } else {
            (prepared.rest[p as usize], &whole)
        };
        let place = blended_position(from.as_dvec3(), bones, values, motions).as_vec3();
        [particle[0], particle[1], particle[2]] = place.to_array();
    };
    let Local { region, particles, .. } = local;
    particles.par_iter_mut().with_min_len(RUN).zip(&region.global).for_each(moved);
}
