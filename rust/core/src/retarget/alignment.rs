//! The rotation that turns one set of points onto another.

use glam::{DMat3, DQuat, DVec3};

/// Steps of the refinement; it doubles the correct digits per step.
const STEPS: usize = 60;
/// How much the identity is preferred where the points do not decide, as along a straight chain of bones.
const PREFERENCE: f64 = 1e-6;

/// The rotation R that maximises `sum of to_i . R from_i` over pairs of centred points.
///
/// Refines the best of the 24 rotations of a cube by the method of Mueller, Bender, Chentanez and Macklin (A robust method
/// to extract the rotational part of deformations, Motion in Games 2016, doi:10.1145/2994258.2994269), which never
/// returns a reflection.
pub fn best_rotation(pairs: impl Iterator<Item = (DVec3, DVec3)>) -> DMat3 {
    let outer = |(from, to): (DVec3, DVec3)| DMat3::from_cols(to * from.x, to * from.y, to * from.z);
    let mut covariance = pairs.map(outer).fold(DMat3::ZERO, |sum, x| sum + x);
    let size = covariance.to_cols_array().iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if size == 0.0 {
        return DMat3::IDENTITY;
    }
    covariance = covariance * (1.0 / size) + PREFERENCE * DMat3::IDENTITY;
    let score = |q: &DQuat| {
        let r = DMat3::from_quat(*q);
        r.x_axis.dot(covariance.x_axis) + r.y_axis.dot(covariance.y_axis) + r.z_axis.dot(covariance.z_axis)
    };
    let starts = cube_rotations();
    let mut best = *starts.iter().max_by(|a, b| score(a).total_cmp(&score(b))).expect("there are 24");
    for _ in 0..STEPS {
        let r = DMat3::from_quat(best);
        let torque =
            r.x_axis.cross(covariance.x_axis) + r.y_axis.cross(covariance.y_axis) + r.z_axis.cross(covariance.z_axis);
        let turn = torque / (score(&best).abs() + 1e-9);
        if turn.length() < 1e-14 {
            break;
        }
        best = (DQuat::from_scaled_axis(turn) * best).normalize();
    }
    DMat3::from_quat(best)
}

fn cube_rotations() -> Vec<DQuat> {
    let quarter = std::f64::consts::FRAC_PI_2;
    let facing = (0..4)
        .map(|k| DQuat::from_rotation_z(f64::from(k) * quarter))
        .chain([-1.0, 1.0].map(|s| DQuat::from_rotation_y(s * quarter)));
    facing.flat_map(|f| (0..4).map(move |k| f * DQuat::from_rotation_x(f64::from(k) * quarter))).collect()
}

/// The smallest rotation that turns the unit vector `from` into `to`.
pub fn swing(from: DVec3, to: DVec3) -> DMat3 {
    DMat3::from_quat(DQuat::from_rotation_arc(from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_any_rotation() {
        let points = [DVec3::new(1.0, 0.2, 0.1), DVec3::new(-0.3, 0.8, 0.4), DVec3::new(0.1, -0.5, 1.1)];
        for k in 0..200 {
            let angle = |m: usize| ((k * m) as f64).sin() * 3.0;
            let wanted = DMat3::from_euler(glam::EulerRot::XYZ, angle(3), angle(5), angle(7));
            let found = best_rotation(points.iter().map(|&p| (p, wanted * p)));
            assert!((found - wanted).to_cols_array().iter().all(|x| x.abs() < 1e-5), "{k}");
        }
    }

    #[test]
    fn a_line_of_points_does_not_spin() {
        let found = best_rotation([(DVec3::Z, DVec3::Z), (-DVec3::Z, -DVec3::Z)].into_iter());
        assert!((found - DMat3::IDENTITY).to_cols_array().iter().all(|x| x.abs() < 1e-6));
    }
}
