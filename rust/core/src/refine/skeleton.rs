//! Bones at rest, and the path of a pose: how each joint gets from rest to there.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::bones::parents_first;
use crate::error::{Error, Result};

/// Bones at rest: parents and segments, in any one space.
#[derive(Debug, Clone)]
pub(super) struct Skeleton {
    /// Index of each bone's parent, negative for a root.
    pub(super) parents: Vec<i32>,
    /// Head and tail of each bone.
    pub(super) segments: Vec<[DVec3; 2]>,
    /// Bones, parents before children.
    pub(super) order: Vec<usize>,
}

impl Skeleton {
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::InvalidParameter`] for a parent out of range or a loop, or an end that is not finite.
    pub(super) fn new(parents: &[i32], segments: &[[[f64; 3]; 2]], bone_count: usize) -> Result<Self> {
        for (what, found) in [("bone_parents", parents.len()), ("bone_segments", segments.len())] {
            if found != bone_count {
                return Err(Error::LengthMismatch { what, found, expected: bone_count });
            }
        }
        let invalid = |name, value, must| Err(Error::InvalidParameter { name, value, must });
        if let Some(&value) = segments.iter().flatten().flatten().find(|x| !x.is_finite()) {
            return invalid("bone_segments", value, "every head and tail must be finite");
        }
        let order = match parents_first(parents) {
            Ok(order) => order,
            Err(bone) => {
                let must = "a parent must be another bone and not below its child, or -1";
                return invalid("bone_parents", parents[bone].into(), must);
            }
        };
        let segments = segments.iter().map(|ends| ends.map(DVec3::from)).collect();
        Ok(Self { parents: parents.to_vec(), segments, order })
    }

    /// The parent of `bone` if it has one.
    pub(super) fn parent(&self, bone: usize) -> Option<usize> {
        usize::try_from(self.parents[bone]).ok()
    }

    /// The child whose head lies nearest to the tail of `bone`, for walking along a limb.
    pub(super) fn next(&self, bone: usize) -> Option<usize> {
        let tail = self.segments[bone][1];
        let children = (0..self.parents.len()).filter(|&j| self.parent(j) == Some(bone));
        let distance = |j: &usize| self.segments[*j][0].distance_squared(tail);
        children.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

/// How one joint turns, at rest space of its bone's head.
#[derive(Debug, Clone, Copy)]
struct Turn {
    /// Of the bone's direction.
    swing: DQuat,
    /// Everything else: twist about the bone, scale, and the head's own displacement.
    rest: DMat3,
    moved: DVec3,
}

/// A pose in steps: joints swing from 0 to their angle, whatever else they do is there from the start.
///
/// Twist takes no steps because dual quaternions already keep its volume, and steps cost it 2 %.
#[derive(Debug)]
pub(super) struct Path<'a> {
    skeleton: &'a Skeleton,
    pose: &'a [DAffine3],
    turns: Vec<Option<Turn>>,
}

impl<'a> Path<'a> {
    pub(super) fn new(skeleton: &'a Skeleton, pose: &'a [DAffine3]) -> Self {
        let turn = |j: usize| {
            let parent = skeleton.parent(j)?;
            if pose[parent].matrix3.determinant().abs() < 1e-9 {
                return None;
            }
            let relative = pose[parent].inverse() * pose[j];
            let [head, tail] = skeleton.segments[j];
            let rotation = rotation_of(&relative.matrix3);
            let (swing, _) = swing_and_twist(rotation, (tail - head).normalize_or(DVec3::Y));
            let rest = DMat3::from_quat(swing.inverse()) * relative.matrix3;
            Some(Turn { swing, rest, moved: relative.transform_point3(head) - head })
        };
        Self { skeleton, pose, turns: (0..pose.len()).map(turn).collect() }
    }

    /// The angle by which the bone's direction turns against its parent, radians.
    pub(super) fn swing_angle(&self, bone: usize) -> f64 {
        self.turns[bone].map_or(0.0, |turn| angle(turn.swing))
    }

    /// The angle of the whole relative rotation, radians.
    pub(super) fn angle(&self, bone: usize) -> f64 {
        self.turns[bone].map_or(0.0, |turn| angle(turn.swing * rotation_of(&turn.rest)))
    }

    /// How far the limb is straight above the head of `bone` and below it: up to the next joint that swings by more than
    /// `most` (radians).
    pub(super) fn straight(&self, bone: usize, most: f64) -> [f64; 2] {
        let skeleton = self.skeleton;
        let up = std::iter::successors(skeleton.parent(bone), |&at| skeleton.parent(at));
        // Bones hang on each other without a loop, so that every way down ends.
        let down = std::iter::successors(skeleton.next(bone), |&at| skeleton.next(at));
        [self.first_bend(bone, up, most), self.first_bend(bone, down, most)]
    }

    fn first_bend(&self, from: usize, along: impl Iterator<Item = usize>, most: f64) -> f64 {
        let (mut length, mut last) = (0.0, from);
        for bone in along {
            length += self.skeleton.segments[bone][0].distance(self.skeleton.segments[last][0]);
            if self.swing_angle(bone) > most {
                return length;
            }
            last = bone;
        }
        f64::INFINITY
    }

    /// The bones' transforms when every swing has come `share` (0 to 1) of its way.
    pub(super) fn at(&self, share: f64) -> Vec<DAffine3> {
        let mut bones = self.pose.to_vec();
        if share == 1.0 {
            return bones;
        }
        for &j in &self.skeleton.order {
            let (Some(turn), Some(parent)) = (self.turns[j], self.skeleton.parent(j)) else { continue };
            let head = self.skeleton.segments[j][0];
            let matrix3 = DMat3::from_quat(DQuat::IDENTITY.slerp(turn.swing, share)) * turn.rest;
            let local = DAffine3 { matrix3, translation: head + turn.moved - matrix3 * head };
            bones[j] = bones[parent] * local;
        }
        bones
    }
}

/// The nearest rotation, by the polar decomposition's iteration.
pub(super) fn rotation_of(matrix: &DMat3) -> DQuat {
    let mut m = *matrix;
    if m.determinant() < 0.0 {
        m.x_axis = -m.x_axis;
    }
    if m.determinant().abs() < 1e-12 {
        return DQuat::IDENTITY;
    }
    for _ in 0..20 {
        let next = (m + m.inverse().transpose()) * 0.5;
        let change = (next - m).abs_diff_eq(DMat3::ZERO, 1e-12);
        m = next;
        if change {
            break;
        }
    }
    DQuat::from_mat3(&m).normalize()
}

/// `rotation = swing * twist`, the twist about `axis`.
pub(super) fn swing_and_twist(rotation: DQuat, axis: DVec3) -> (DQuat, DQuat) {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    let along = axis * rotation.xyz().dot(axis);
    let length = (along.length_squared() + rotation.w * rotation.w).sqrt();
    let twist = if length < 1e-9 {
        DQuat::IDENTITY
    } else {
        DQuat::from_xyzw(along.x / length, along.y / length, along.z / length, rotation.w / length)
    };
    (rotation * twist.inverse(), twist)
}

fn angle(rotation: DQuat) -> f64 {
    2.0 * rotation.xyz().length().atan2(rotation.w.abs())
}
