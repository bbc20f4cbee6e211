//! The whole template from the joints that were placed: what lies along a limb is there already, what hangs on it follows.

use glam::{DQuat, DVec3};

use super::super::{Embedding, Report, Template, hierarchy};
use super::Alignment;
use super::discrete::Chosen;
use super::reduced::Reduced;
use super::symmetry::{Side, Symmetry};
use super::ways::Points;
use crate::adjacency::NONE;
use crate::error::Result;
use crate::inside::Winding;
use crate::mesh::TriMesh;
use crate::progress::Progress;

/// A bone that hangs on another is this much less certain.
const HANGING: f32 = 0.9;

/// Bones stretch by no more than this, either way, to what hangs on them.
const MOST_STRETCH: f64 = 2.0;

/// What moves a bone and all that hangs on it.
#[derive(Debug, Clone, Copy)]
struct Frame {
    from: DVec3,
    to: DVec3,
    rotation: DQuat,
    scale: f64,
}

impl Frame {
    fn new([from, from_end]: [DVec3; 2], [to, to_end]: [DVec3; 2], scale: f64) -> Self {
        let (old, new) = (from_end - from, to_end - to);
        let stretch = if old.length() > 0.0 { new.length() / old.length() } else { scale };
        let scale = stretch.clamp(scale / MOST_STRETCH, scale * MOST_STRETCH);
        let (old, new) = (old.normalize_or_zero(), new.normalize_or_zero());
        let is_turned = old != DVec3::ZERO && new != DVec3::ZERO;
        let rotation = if is_turned { DQuat::from_rotation_arc(old, new) } else { DQuat::IDENTITY };
        Self { from, to, rotation, scale }
    }

    fn point(&self, p: DVec3) -> DVec3 {
        self.to + self.scale * (self.rotation * (p - self.from))
    }
}

/// A bone that was placed, and the next point of its limb: before and after.
struct Placed {
    bone: usize,
    before: [DVec3; 2],
    after: [DVec3; 2],
    confidence: f32,
}

pub(super) fn expand(
    template: &Template<'_>,
    reduced: &Reduced,
    points: &Points,
    chosen: &Chosen,
    alignment: &Alignment,
    symmetry: Option<&Symmetry>,
) -> Embedding {
    let mut placed: Vec<Option<Placed>> = (0..template.len()).map(|_| None).collect();
    for bone in placed_bones(template, reduced, points, chosen) {
        let better = |known: &Placed| aligned(template, &bone) > aligned(template, known);
        if placed[bone.bone].as_ref().is_none_or(better) {
            let place = bone.bone;
            placed[place] = Some(bone);
        }
    }
    let mut frames: Vec<Option<(Frame, f32)>> = vec![None; template.len()];
    let mut embedding = Embedding {
        heads: vec![[0.0; 3]; template.len()],
        tails: vec![[0.0; 3]; template.len()],
        confidence: vec![0.0; template.len()],
        report: Report::default(),
    };
    let all = Frame { from: alignment.from, to: alignment.to, rotation: DQuat::IDENTITY, scale: alignment.scale };
    let parents = hierarchy::parents(template);
    for j in 0..template.len() {
        let (frame, confidence) = frame_of(j, &parents, &placed, &mut frames, all);
        let (mut head, mut tail) = (frame.point(template.head(j)), frame.point(template.tail(j)));
        if let Some(bone) = &placed[j] {
            head = bone.after[0];
            // A tail that is the next head stays it.
            let gap = template.tail(j).distance(bone.before[1]);
            if gap < 0.1 * bone.before[0].distance(bone.before[1]) {
                tail = bone.after[1];
            }
        }
        (embedding.heads[j], embedding.tails[j]) = (head.as_vec3().to_array(), tail.as_vec3().to_array());
        embedding.confidence[j] = confidence;
    }
    if let Some(symmetry) = symmetry {
        mirror(&mut embedding, symmetry);
    }
    embedding
}

/// How well the next point agrees with the bone's own direction.
fn aligned(template: &Template<'_>, bone: &Placed) -> f64 {
    let own = template.tail(bone.bone) - template.head(bone.bone);
    own.normalize_or_zero().dot((bone.before[1] - bone.before[0]).normalize_or_zero())
}

fn placed_bones(template: &Template<'_>, reduced: &Reduced, points: &Points, chosen: &Chosen) -> Vec<Placed> {
    let mut placed = Vec::new();
    for (k, joint) in reduced.joints.iter().enumerate() {
        let Some(limb) = &joint.limb else { continue };
        let confidence = (-chosen.penalties[k]).exp() as f32;
        let start = &reduced.joints[limb.from];
        let mut before = vec![start.position];
        before.extend(limb.bones.iter().map(|&bone| template.head(bone)));
        before.push(joint.position);
        let mut after = vec![points.joints[limb.from]];
        after.extend(&points.along[k]);
        after.push(points.joints[k]);
        let bones = std::iter::once(start.bone).chain(limb.bones.iter().copied());
        for (place, bone) in bones.enumerate() {
            let pair = |points: &[DVec3]| [points[place], points[place + 1]];
            placed.push(Placed { bone, before: pair(&before), after: pair(&after), confidence });
        }
    }
    placed
}

/// The frame of the bone, or of the nearest one above it that was placed.
fn frame_of(
    j: usize,
    parents: &[Option<usize>],
    placed: &[Option<Placed>],
    frames: &mut [Option<(Frame, f32)>],
    all: Frame,
) -> (Frame, f32) {
    if let Some(known) = frames[j] {
        return known;
    }
    let found = match (&placed[j], parents[j]) {
        (Some(bone), _) => (Frame::new(bone.before, bone.after, all.scale), bone.confidence),
        (None, Some(parent)) => {
            let (frame, confidence) = frame_of(parent, parents, placed, frames, all);
            (frame, HANGING * confidence)
        }
        (None, None) => (all, HANGING),
    };
    frames[j] = Some(found);
    found
}

/// Bones whose images were placed are their images; bones on the plane stay on it.
fn mirror(embedding: &mut Embedding, symmetry: &Symmetry) {
    let point = |p: [f32; 3]| glam::Vec3::from(p).as_dvec3();
    for j in 0..embedding.heads.len() {
        let image = symmetry.bone_image[j];
        if image == NONE {
            continue;
        }
        let image = image as usize;
        let (head, tail) = (point(embedding.heads[j]), point(embedding.tails[j]));
        if image == j {
            embedding.heads[j] = symmetry.on_plane(head).as_vec3().to_array();
            embedding.tails[j] = symmetry.on_plane(tail).as_vec3().to_array();
        } else if symmetry.side_of(head, false) == Side::Positive {
            embedding.heads[image] = symmetry.image(head).as_vec3().to_array();
            embedding.tails[image] = symmetry.image(tail).as_vec3().to_array();
            embedding.confidence[image] = embedding.confidence[j];
        }
    }
}

/// Bones whose heads are outside; they are not to be trusted.
pub(super) fn outside(mesh: &TriMesh<'_>, embedding: &mut Embedding, progress: &Progress) -> Result<Vec<u32>> {
    let inside = Winding::new(mesh).are_inside(&embedding.heads, progress)?;
    let outside: Vec<u32> = (0..).zip(inside).filter(|&(_, inside)| !inside).map(|(j, _)| j).collect();
    outside.iter().for_each(|&j| embedding.confidence[j as usize] *= 0.3);
    Ok(outside)
}
