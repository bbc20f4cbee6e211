//! Dual quaternion skinning, exactly as Blender's Armature modifier does it with Preserve Volume.
//!
//! L. Kavan, S. Collins, J. Žára, C. O'Sullivan: Skinning with dual quaternions. Symposium on Interactive 3D Graphics and
//! Games 2007. Where a bone scales, Blender moves the vertex itself by the scale and blends the rotations alone
//! (`math_rotation.cc`, `add_weighted_dq_dq_pivot`).

use glam::{DAffine3, DMat3, DQuat, DVec3, DVec4, Vec3};
use rayon::prelude::*;

use super::{LEAST_TOTAL_WEIGHT, check_length};
use crate::error::Result;
use crate::weights::Weights;

/// How far axes may be from orthonormal before a transform counts as scaled, as in Blender.
const ORTHONORMAL: f64 = 1e-4;

/// A rigid motion as a dual quaternion, and the scale before it if there is any.
#[derive(Debug, Clone, Copy)]
pub struct DualQuaternion {
    real: DVec4,
    dual: DVec4,
    scale: Option<DAffine3>,
}

impl DualQuaternion {
    /// The parts of `transform`; `rest` is the bone's rest matrix, in whose axes a scale is separated.
    pub fn new(transform: &DAffine3, rest: &DAffine3) -> Self {
        let posed = *transform * *rest;
        let axes = posed.matrix3;
        let lengths = DVec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length());
        let scaled = (lengths - DVec3::ONE).length_squared() > ORTHONORMAL * ORTHONORMAL
            || !is_orthonormal(&transform.matrix3)
            || transform.matrix3.determinant() < 0.0;
        if !scaled {
            return Self::rigid(DQuat::from_mat3(&transform.matrix3), transform.translation, None);
        }
        let turned = DAffine3 { matrix3: orthogonal_to_y(&axes), translation: posed.translation };
        let turned =
            DAffine3 { matrix3: DMat3::from_quat(DQuat::from_mat3(&turned.matrix3)), translation: turned.translation };
        let (rest_inverse, turned_inverse) = (rest.inverse(), turned.inverse());
        let rotation = turned * rest_inverse;
        let scale = *rest * (turned_inverse * posed) * rest_inverse;
        Self::rigid(DQuat::from_mat3(&rotation.matrix3), rotation.translation, Some(scale))
    }

    /// Of a rotation, then a translation.
    pub fn rigid(rotation: DQuat, translation: DVec3, scale: Option<DAffine3>) -> Self {
        let real = DVec4::from(rotation);
        Self { real, dual: dual_part(translation, real), scale }
    }

    /// The real and the dual part, if there is no scale.
    pub(crate) fn rigid_parts(&self) -> Option<[DVec4; 2]> {
        self.scale.is_none().then_some([self.real, self.dual])
    }
}

/// Half the product of a translation and a rotation (x, y, z, w).
fn dual_part(translation: DVec3, rotation: DVec4) -> DVec4 {
    let (vector, scalar) = (rotation.truncate(), rotation.w);
    (0.5 * (translation * scalar + translation.cross(vector))).extend(-0.5 * translation.dot(vector))
}

fn is_orthonormal(m: &DMat3) -> bool {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let unit = [x, y, z].iter().all(|axis| (axis.length_squared() - 1.0).abs() < ORTHONORMAL);
    unit && [x.dot(y), y.dot(z), z.dot(x)].iter().all(|cosine| cosine.abs() < ORTHONORMAL)
}

/// The axes turned at right angles to y, which stays (`orthogonalize_m4` of Blender for axis 1), unit length.
fn orthogonal_to_y(m: &DMat3) -> DMat3 {
    let y = m.y_axis.normalize_or(DVec3::Y);
    let (x, z) = (m.x_axis, m.z_axis);
    // A matrix that mirrors keeps its handedness here, as the quaternion made of it expects in Blender.
    let z = if y.dot(x).abs() < x.length() * (1.0 - 1e-9) { x.cross(y) } else { z };
    let z = z.normalize_or(y.any_orthonormal_vector());
    DMat3::from_cols(y.cross(z), y, z)
}

/// Where `position` goes under bones blended by `weights`; an unweighted vertex stays.
pub fn blended_position(position: DVec3, bones: &[u32], weights: &[f32], pose: &[DualQuaternion]) -> DVec3 {
    let (mut real, mut dual, mut total) = (DVec4::ZERO, DVec4::ZERO, 0.0);
    for (&bone, &weight) in bones.iter().zip(weights) {
        let (motion, weight) = (&pose[bone as usize], f64::from(weight));
        total += weight;
        let moved = motion.scale.map(|scale| scale.transform_point3(position) - position);
        let motion_dual = moved.map_or(motion.dual, |by| motion.dual + after(motion.real, by));
        // Opposite quaternions are the same rotation: the nearer one to the sum so far.
        let sign = if motion.real.dot(real) < 0.0 { -weight } else { weight };
        real += motion.real * sign;
        dual += motion_dual * sign;
    }
    if total <= LEAST_TOTAL_WEIGHT || real.length_squared() == 0.0 {
        return position;
    }
    transform(position, real, dual)
}

/// What a translation before the rotation `real` adds to the dual part.
fn after(real: DVec4, translation: DVec3) -> DVec4 {
    let vector = real.truncate();
    (0.5 * (translation * real.w + vector.cross(translation))).extend(-0.5 * vector.dot(translation))
}

fn transform(position: DVec3, real: DVec4, dual: DVec4) -> DVec3 {
    let square = real.length_squared();
    let (v, w) = (real.truncate(), real.w);
    let turned = position * (w * w - v.length_squared()) + v * (2.0 * v.dot(position)) + v.cross(position) * (2.0 * w);
    let moved = 2.0 * (dual.truncate() * w - v * dual.w + v.cross(dual.truncate()));
    (turned + moved) / square
}

/// Posed positions (V, 3) of `rest_positions` (V, 3) under `weights`, all in mesh space.
///
/// `rest_bones` are the rest matrices of the bones; they matter only where bones scale. Without them mesh axes are taken.
///
/// # Errors
/// [`crate::Error::LengthMismatch`] if positions, weights and bones do not fit together.
pub fn dual_quaternion_blend(
    rest_positions: &[[f32; 3]],
    weights: &Weights,
    pose_from_rest: &[DAffine3],
    rest_bones: Option<&[DAffine3]>,
) -> Result<Vec<[f32; 3]>> {
    check_length("rest_positions", rest_positions.len(), weights.vertex_count())?;
    check_length("pose_from_rest", pose_from_rest.len(), weights.n_bones() as usize)?;
    check_length("rest_bones", rest_bones.map_or(pose_from_rest.len(), <[_]>::len), pose_from_rest.len())?;
    let rest = |j: usize| rest_bones.map_or(DAffine3::IDENTITY, |bones| bones[j]);
    let pose: Vec<_> = pose_from_rest.iter().enumerate().map(|(j, m)| DualQuaternion::new(m, &rest(j))).collect();
    let posed = |(i, &position): (usize, &[f32; 3])| {
        let (bones, values) = weights.row(i);
        blended_position(Vec3::from(position).as_dvec3(), bones, values, &pose).as_vec3().to_array()
    };
    Ok(rest_positions.par_iter().enumerate().with_min_len(1024).map(posed).collect())
}
