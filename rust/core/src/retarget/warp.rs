//! The target brought into the source's rest pose and proportions, bone by bone.

use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::alignment::{best_rotation, swing};
use super::rows::Row;
use super::skeleton::{Guide, RestBone};

/// Bones that share in one vertex.
const NEAREST: usize = 3;
/// Power of the distance with which a bone's share falls.
const POWER: i32 = 4;
/// Distance below which a bone does not gain any more, as a share of the mean bone length.
const CLOSEST: f64 = 1e-3;

/// Turn below which two characters face the same way, radians: less than that is a difference of pose.
const SAME_FACING: f64 = 0.44;

/// A vertex is carried by the nearest bones of the target: each moves it as its own frame moves into that of its partner,
/// stretched along the bone by the ratio of the lengths and across by one ratio for the whole body.
#[derive(Debug)]
pub struct Warp {
    bones: Vec<BoneWarp>,
    closest: f64,
}

#[derive(Debug)]
struct BoneWarp {
    target: RestBone,
    source: RestBone,
    /// Source space from target space.
    rotation: DMat3,
    along: f64,
    across: f64,
}

impl Warp {
    /// Prepares the warp by `guides` (at least one).
    pub fn new(guides: &[Guide]) -> Self {
        let bones: Vec<(RestBone, RestBone)> = guides.iter().map(|guide| (guide.source, guide.target)).collect();
        let facing = facing(&bones);
        let across = size_ratio(&bones);
        let bone = |&(source, target): &(RestBone, RestBone)| BoneWarp {
            rotation: swing((facing * target.direction()).normalize(), source.direction()) * facing,
            along: source.length / target.length,
            across,
            source,
            target,
        };
        let mean_length = bones.iter().map(|(_, target)| target.length).sum::<f64>() / bones.len() as f64;
        Self { bones: bones.iter().map(bone).collect(), closest: CLOSEST * mean_length }
    }

    /// Ratio of the sizes of the characters, source by target.
    pub fn across(&self) -> f64 {
        self.bones[0].across
    }

    /// Where `positions` (V) would lie if each were moved by bones of these weights (V): the k-th guide's share is that of the
    /// target's bone b with `guide_of[b] = k`. Vertices without a guide go with the nearest bones.
    pub fn apply_weighted(&self, positions: &[DVec3], rows: &[Row], guide_of: &[Option<usize>]) -> Vec<DVec3> {
        let carried = |(&position, row): (&DVec3, &Row)| {
            let (mut sum, mut total) = (DVec3::ZERO, 0.0);
            for &(bone, share) in row {
                if let Some(k) = guide_of[bone as usize] {
                    sum += share * self.bones[k].apply(position);
                    total += share;
                }
            }
            if total > 0.0 { sum / total } else { self.apply_one(position) }
        };
        positions.par_iter().zip(rows).with_min_len(64).map(carried).collect()
    }

    /// Where `positions` (V) of the target would lie on the source.
    pub fn apply(&self, positions: &[DVec3]) -> Vec<DVec3> {
        positions.par_iter().with_min_len(64).map(|&p| self.apply_one(p)).collect()
    }

    fn apply_one(&self, position: DVec3) -> DVec3 {
        let nearest = self.nearest(position);
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for (distance, bone) in nearest.into_iter().filter(|(distance, _)| distance.is_finite()) {
            // Relative to the nearest, so that no power overflows.
            let share = (nearest[0].0 / distance).powi(POWER);
            sum += share * self.bones[bone].apply(position);
            total += share;
        }
        sum / total
    }

    /// Distances and indices of the nearest bones, ascending; infinite where there are fewer.
    fn nearest(&self, position: DVec3) -> [(f64, usize); NEAREST] {
        let mut nearest = [(f64::INFINITY, 0); NEAREST];
        for (b, bone) in self.bones.iter().enumerate() {
            let mut entry = (bone.target.distance(position).max(self.closest), b);
            for place in &mut nearest {
                if entry.0 < place.0 {
                    std::mem::swap(&mut entry, place);
                }
            }
        }
        nearest
    }
}

impl BoneWarp {
    fn apply(&self, position: DVec3) -> DVec3 {
        let local = self.rotation * (position - self.target.head);
        let axis = self.source.direction();
        let along = local.dot(axis) * axis;
        self.source.head + self.along * along + self.across * (local - along)
    }
}

/// The rotation that turns the target's skeleton onto the source's, so that neither need face the same way.
fn facing(bones: &[(RestBone, RestBone)]) -> DMat3 {
    let ends = |bone: &RestBone| [bone.head, bone.tail()];
    let centre = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    let (source, target): (Vec<DVec3>, Vec<DVec3>) =
        bones.iter().flat_map(|(source, target)| std::iter::zip(ends(source), ends(target))).unzip();
    let (source_centre, target_centre) = (centre(&source), centre(&target));
    let turn = best_rotation(std::iter::zip(target, source).map(|(t, s)| (t - target_centre, s - source_centre)));
    let angle = DQuat::from_mat3(&turn).to_axis_angle().1;
    if angle < SAME_FACING { DMat3::IDENTITY } else { turn }
}

/// Ratio of the summed lengths: a height would depend on how the character stands.
fn size_ratio(bones: &[(RestBone, RestBone)]) -> f64 {
    let sum = |of: fn(&(RestBone, RestBone)) -> f64| bones.iter().map(of).sum::<f64>();
    sum(|(source, _)| source.length) / sum(|(_, target)| target.length)
}
