//! Where particles go with the bones: the start of every step, and the place of what the solver leaves to the skeleton.

use glam::{DAffine3, Vec3};
use rayon::prelude::*;

use super::constraint::{Axis, bind};
use super::frame::ActiveJoint;
use super::local::Local;
use super::prepared::Prepared;
use crate::skinning::{DualQuaternion, blended_position};

/// Particles that one task moves.
const RUN: usize = 512;

fn motions(pose: &[DAffine3]) -> Vec<DualQuaternion> {
    pose.iter().map(|m| DualQuaternion::new(m, &DAffine3::IDENTITY)).collect()
}

/// The posed place of every local particle by dual quaternions.
pub(super) fn skinned(prepared: &Prepared, local: &Local, pose: &[DAffine3]) -> Vec<Vec3> {
    let motions = motions(pose);
    let posed = |&p: &u32| {
        let (bones, values) = prepared.weights.row(p as usize);
        blended_position(prepared.rest[p as usize].as_dvec3(), bones, values, &motions).as_vec3()
    };
    local.global.par_iter().with_min_len(RUN).map(posed).collect()
}

/// Puts what the skeleton decides where it belongs: skinned, and near a joint about as far from the bones as at rest, as
/// the weights' long tails would swell and thin the limb there.
pub(super) fn place_bound(local: &mut Local, skin: &[Vec3], active: &[ActiveJoint<'_>], axes: &[Axis]) {
    for (particle, place) in local.particles.iter_mut().zip(skin) {
        if particle[3] == 0.0 {
            [particle[0], particle[1], particle[2]] = place.to_array();
        }
    }
    for ((joint, axis), members) in active.iter().zip(axes).zip(&local.beyond) {
        if !joint.joint.is_limb {
            continue;
        }
        for member in members {
            let particle = &mut local.particles[member.particle as usize];
            let place = Vec3::new(particle[0], particle[1], particle[2]);
            if particle[3] == 0.0 {
                let (nearest, farthest) = joint.bounds_beyond(member);
                let place = place + bind(axis, place, nearest, farthest);
                [particle[0], particle[1], particle[2]] = place.to_array();
            }
        }
    }
}

/// Moves free particles by what the bones did since the last step.
pub(super) fn follow(prepared: &Prepared, local: &mut Local, before: &[DAffine3], after: &[DAffine3]) {
    let changes: Vec<DAffine3> = before.iter().zip(after).map(|(b, a)| *a * b.inverse()).collect();
    let motions = motions(&changes);
    let moved = |(particle, &p): (&mut [f32; 4], &u32)| {
        if particle[3] > 0.0 {
            let (bones, values) = prepared.weights.row(p as usize);
            let place = Vec3::new(particle[0], particle[1], particle[2]).as_dvec3();
            let place = blended_position(place, bones, values, &motions).as_vec3();
            [particle[0], particle[1], particle[2]] = place.to_array();
        }
    };
    local.particles.par_iter_mut().with_min_len(RUN).zip(&local.global).for_each(moved);
}
