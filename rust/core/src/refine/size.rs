//! A pose that makes the whole body larger or smaller, as a rig's root does, and the pose without that.

use std::borrow::Cow;

use glam::DAffine3;

use super::joints::Joint;

/// Sizes that differ less from 1 are rounding.
const ROUNDING: f64 = 1e-6;

/// The size that most bones at `joints` have in a pose.
pub(super) fn of_body(joints: &[Joint], pose: &[DAffine3]) -> f64 {
    let bones = joints.iter().flat_map(|joint| [joint.parent, joint.bone]);
    let mut sizes: Vec<f64> = bones.map(|b| pose[b].matrix3.determinant().abs().cbrt()).collect();
    if sizes.is_empty() {
        return 1.0;
    }
    let middle = sizes.len() / 2;
    let size = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    if size.is_finite() && size > ROUNDING && (size - 1.0).abs() > ROUNDING { size } else { 1.0 }
}

/// `pose` with everything `size` times smaller.
pub(super) fn without(size: f64, pose: &[DAffine3]) -> Cow<'_, [DAffine3]> {
    if size == 1.0 {
        return pose.into();
    }
    let smaller = |&bone: &DAffine3| DAffine3 { matrix3: bone.matrix3 / size, translation: bone.translation / size };
    pose.iter().map(smaller).collect()
}

/// Positions `by` times larger.
pub(super) fn scale(positions: &mut [[f32; 3]], by: f64) {
    if by != 1.0 {
        positions.iter_mut().for_each(|p| *p = p.map(|x| (f64::from(x) * by) as f32));
    }
}
