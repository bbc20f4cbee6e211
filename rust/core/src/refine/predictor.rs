//! Where particles go with the bones: the start of every step, and the place of what the solver leaves to the skeleton.

use glam::{Affine3A, DAffine3, DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::constraint::{Axis, bind};
use super::frame::ActiveJoint;
use super::local::Local;
use super::prepared::Prepared;
use super::region::Region;
use crate::skinning::{DualQuaternion, LEAST_TOTAL_WEIGHT, blended_position};

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
    let motions = Motions::new(pose);
    let placed = |(particle, &p): (&mut [f32; 4], &u32)| {
        let (bones, values) = prepared.weights.row(p as usize);
        let place = motions.blended(prepared.rest[p as usize], bones, values);
        [particle[0], particle[1], particle[2]] = place.to_array();
    };
    let Local { region, particles, .. } = local;
    particles.par_iter_mut().with_min_len(RUN).zip(&region.global).for_each(placed);
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
    let (changes, whole) = (Motions::new(&changes), Motions::new(after));
    let moved = |(particle, &p): (&mut [f32; 4], &u32)| {
        let (bones, values) = prepared.weights.row(p as usize);
        let (from, motions) = if particle[3] > 0.0 {
            (Vec3::new(particle[0], particle[1], particle[2]), &changes)
        } else {
            (prepared.rest[p as usize], &whole)
        };
        [particle[0], particle[1], particle[2]] = motions.blended(from, bones, values).to_array();
    };
    let Local { region, particles, .. } = local;
    particles.par_iter_mut().with_min_len(RUN).zip(&region.global).for_each(moved);
}

/// Motions in single precision, which is enough for the steps of a path (its particles are kept in it), if none scales.
struct Motions {
    exact: Vec<DualQuaternion>,
    rigid: Option<Vec<[Vec4; 2]>>,
    /// The bones' own motions, for what one of them moves alone.
    alone: Vec<Affine3A>,
}

/// The share of all weights from which a bone is alone.
const ALONE: f32 = 1.0 - 1e-6;

impl Motions {
    fn new(pose: &[DAffine3]) -> Self {
        let exact = motions(pose);
        let rigid = exact.iter().map(|motion| motion.rigid_parts().map(|parts| parts.map(|part| part.as_vec4())));
        Self { rigid: rigid.collect(), exact, alone: pose.iter().map(DAffine3::as_affine3a).collect() }
    }

    /// As [`blended_position`].
    fn blended(&self, position: Vec3, bones: &[u32], weights: &[f32]) -> Vec3 {
        let Some(rigid) = &self.rigid else {
            return blended_position(position.as_dvec3(), bones, weights, &self.exact).as_vec3();
        };
        let least = weights.iter().sum::<f32>() * ALONE;
        if let Some(k) = weights.iter().position(|&weight| f64::from(weight) > LEAST_TOTAL_WEIGHT && weight >= least) {
            return self.alone[bones[k] as usize].transform_point3(position);
        }
        let (mut real, mut dual, mut total) = (Vec4::ZERO, Vec4::ZERO, 0.0);
        for (&bone, &weight) in bones.iter().zip(weights) {
            let [motion_real, motion_dual] = rigid[bone as usize];
            total += weight;
            // Opposite quaternions are the same rotation: the nearer one to the sum so far.
            let sign = if motion_real.dot(real) < 0.0 { -weight } else { weight };
            real += motion_real * sign;
            dual += motion_dual * sign;
        }
        let square = real.length_squared();
        if f64::from(total) <= LEAST_TOTAL_WEIGHT || square == 0.0 {
            return position;
        }
        let (v, moved) = (real.truncate(), dual.truncate());
        let turned = v.cross(position) + position * real.w;
        let by = v.cross(turned) + moved * real.w - v * dual.w + v.cross(moved);
        position + by * (2.0 / square)
    }
}
