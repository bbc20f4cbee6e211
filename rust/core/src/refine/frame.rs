//! What a pose asks of each joint: which are active, how far they reach, where their planes are at each step.

use glam::{DAffine3, Vec3};

use super::constraint::{Axis, HalfSpace};
use super::joints::{Joint, Member};
use super::skeleton::{Path, rotation_of};

/// Joints that turn less than this stay as skinning leaves them.
const LEAST_ANGLE: f64 = 5.0;
/// Beyond this bend a limb's sides meet along all of it; the reach grows no further.
const MOST_BEND: f32 = 2.5;
/// What a joint's region reaches beyond the crease, in radii.
const MARGIN: f32 = 1.2;
/// Reaches are multiples of this many radii, so that poses near each other have one region.
const STEP: f32 = 0.25;
/// Gap on each side of the plane, in radii, for a joint that has turned by a right angle or more.
const GAP: f32 = 0.016;

/// From this swing on (radians) skin past a joint is far from the line of the bone before it.
const BENDS: f64 = 0.26;

/// A joint that turns in this frame.
#[derive(Debug)]
pub(super) struct ActiveJoint<'a> {
    pub(super) joint: &'a Joint,
    /// How far along the bones its particles move freely.
    pub(super) reach: f32,
    /// The angle by which it swings, radians.
    pub(super) swing: f32,
    /// What else it turns by, radians.
    pub(super) twist: f32,
    /// How far the limb is straight above the joint and below it, up to the next joint that bends.
    straight: [f32; 2],
}

/// The joints that turn, in order of bones.
pub(super) fn active_joints<'a>(joints: &'a [Joint], path: &Path<'_>, pose: &[DAffine3]) -> Vec<ActiveJoint<'a>> {
    let turns = |joint: &&Joint| path.angle(joint.bone) > LEAST_ANGLE.to_radians();
    let active = |joint: &'a Joint| {
        let [up, down] = posed_axis(joint, pose).directions;
        let bend = (-up).angle_between(down).min(MOST_BEND);
        let twist = (path.angle(joint.bone) - path.swing_angle(joint.bone)).max(0.0) as f32;
        let radii = (bend / 2.0).tan() + MARGIN + twist / std::f32::consts::PI;
        let reach = joint.radius * (radii / STEP).ceil() * STEP;
        let straight = path.straight(joint.bone, BENDS).map(|length| length as f32);
        ActiveJoint { joint, reach, swing: path.swing_angle(joint.bone) as f32, twist, straight }
    };
    joints.iter().filter(turns).map(active).collect()
}

/// The joint's bones in a pose.
pub(super) fn posed_axis(joint: &Joint, pose: &[DAffine3]) -> Axis {
    let origin = pose[joint.parent].transform_point3(joint.axis.origin.as_dvec3());
    let [up, down] = joint.axis.directions;
    let turned = |bone: usize, direction: Vec3| {
        (rotation_of(&pose[bone].matrix3) * direction.as_dvec3()).as_vec3().normalize_or_zero()
    };
    Axis { origin: origin.as_vec3(), directions: [turned(joint.parent, up), turned(joint.bone, down)] }
}

impl ActiveJoint<'_> {
    /// The plane between the bones, when the joint has swung by `share` of its way. None for what is no limb.
    pub(super) fn plane(&self, axis: &Axis, share: f32) -> Option<HalfSpace> {
        let [up, down] = axis.directions;
        let normal = (down - up).try_normalize()?;
        let gap = GAP * self.joint.radius * (self.swing * share / std::f32::consts::FRAC_PI_2).min(1.0);
        let bends = self.swing > LEAST_ANGLE.to_radians() as f32;
        (self.joint.is_limb && bends).then_some(HalfSpace { origin: axis.origin, normal, gap })
    }

    /// What the joint's region depends on.
    pub(super) fn extent(&self) -> [f32; 3] {
        let [above, below] = self.straight;
        [self.reach, above, below]
    }

    /// The particles that move freely.
    pub(super) fn free(&self) -> impl Iterator<Item = &Member> {
        self.joint.members.iter().filter(|member| member.along < self.reach)
    }

    /// The particles beyond, for twice as far again.
    pub(super) fn beyond(&self) -> impl Iterator<Item = &Member> {
        let beyond = self.joint.members.iter().filter(|member| (self.reach..3.0 * self.reach).contains(&member.along));
        beyond.filter(|member| self.is_beside(member))
    }

    /// Whether a particle is beside the joint's own bones: past the next bend, their lines are not its limb's.
    pub(super) fn is_beside(&self, member: &Member) -> bool {
        let [above, below] = self.straight;
        member.along < if member.side > 0.0 { below } else { above }
    }

    /// Nearest and farthest that a particle beyond the free ones may be from the bones: what skinning says matters more
    /// the farther it is.
    pub(super) fn bounds_beyond(&self, member: &Member) -> (f32, f32) {
        let away = (member.along / self.reach - 1.0).clamp(0.0, 2.0);
        let farther = (away - 1.0).max(0.0);
        (member.distance * (0.98 - 0.49 * away), member.distance * (1.02 + 0.06 * away.min(1.0) + farther * farther))
    }
}
