//! Skinning, exactly as Blender's Armature modifier does it: linear, or by dual quaternions.

mod dual_quaternion;

pub use dual_quaternion::{DualQuaternion, blended_position, dual_quaternion_blend};

use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::weights::Weights;

/// Blender leaves a vertex where it is unless its deform weights sum to more than this (`armature_deform.cc`).
pub const LEAST_TOTAL_WEIGHT: f64 = 1e-4;

/// Bone transforms of one pose from (B, 4, 4) row-major matrices in mesh space. The last rows are not read.
///
/// # Errors
/// [`Error::InvalidParameter`] if an entry is not finite.
pub fn pose_from_matrices(matrices: &[[[f64; 4]; 4]]) -> Result<Vec<DAffine3>> {
    let rows = matrices.iter().flat_map(|m| &m[..3]);
    if let Some(&value) = rows.flatten().find(|x| !x.is_finite()) {
        return Err(Error::InvalidParameter {
            name: "pose_from_rest",
            value,
            must: "every bone matrix must be finite",
        });
    }
    let column = |m: &[[f64; 4]; 4], c: usize| DVec3::new(m[0][c], m[1][c], m[2][c]);
    let affine =
        |m| DAffine3 { matrix3: DMat3::from_cols(column(m, 0), column(m, 1), column(m, 2)), translation: column(m, 3) };
    Ok(matrices.iter().map(affine).collect())
}

/// The transform of one vertex: the sum of its bones' transforms times its weights, divided by the weights' sum.
///
/// The identity for an unweighted vertex, which therefore stays at rest.
pub fn blended_transform(bones: &[u32], weights: &[f32], pose_from_rest: &[DAffine3]) -> DAffine3 {
    let total: f64 = weights.iter().map(|&w| f64::from(w)).sum();
    if total <= LEAST_TOTAL_WEIGHT {
        return DAffine3::IDENTITY;
    }
    let mut blend = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
    for (&bone, &weight) in bones.iter().zip(weights) {
        let (transform, share) = (&pose_from_rest[bone as usize], f64::from(weight) / total);
        blend.matrix3 += transform.matrix3 * share;
        blend.translation += transform.translation * share;
    }
    blend
}

/// Posed positions (V, 3) of `rest_positions` (V, 3) under `weights` and one transform a bone, all in mesh space.
///
/// # Errors
/// [`Error::LengthMismatch`] if positions, weights and bones do not fit together.
pub fn linear_blend(
    rest_positions: &[[f32; 3]],
    weights: &Weights,
    pose_from_rest: &[DAffine3],
) -> Result<Vec<[f32; 3]>> {
    check_length("rest_positions", rest_positions.len(), weights.vertex_count())?;
    check_length("pose_from_rest", pose_from_rest.len(), weights.n_bones() as usize)?;
    let posed = |(i, &position): (usize, &[f32; 3])| {
        let (bones, values) = weights.row(i);
        let transform = blended_transform(bones, values, pose_from_rest);
        transform.transform_point3(Vec3::from(position).as_dvec3()).as_vec3().to_array()
    };
    Ok(rest_positions.par_iter().enumerate().with_min_len(1024).map(posed).collect())
}

pub(crate) fn check_length(what: &'static str, found: usize, expected: usize) -> Result<()> {
    if found == expected { Ok(()) } else { Err(Error::LengthMismatch { what, found, expected }) }
}
