//! Bones at rest, and which bone of one character is which of the other.

use glam::{DMat3, DVec3};

use crate::error::{Error, Result};

/// A bone at rest in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestBone {
    /// Where it starts.
    pub head: DVec3,
    /// Its axes, orthonormal; the bone lies along Y.
    pub axes: DMat3,
    /// From head to tail, world units.
    pub length: f64,
}

impl RestBone {
    /// Unit direction from head to tail.
    pub fn direction(&self) -> DVec3 {
        self.axes.y_axis
    }

    /// Where it ends.
    pub fn tail(&self) -> DVec3 {
        self.head + self.length * self.direction()
    }

    /// Distance of `point` from the segment.
    pub fn distance(&self, point: DVec3) -> f64 {
        let offset = point - self.head;
        let along = offset.dot(self.direction()).clamp(0.0, self.length);
        (offset - along * self.direction()).length()
    }
}

/// The bones of a character.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    bones: Vec<RestBone>,
}

impl Skeleton {
    /// Takes rest matrices `frames` (B, 4, 4) row-major with the bone along +Y, of any scale, and `lengths` (B) in world
    /// units. `what` names the character in errors.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::UnusableBone`] for an entry that is not finite.
    pub fn new(frames: &[[[f64; 4]; 4]], lengths: &[f64], what: &'static str) -> Result<Self> {
        if frames.len() != lengths.len() {
            return Err(Error::LengthMismatch { what: "lengths", found: lengths.len(), expected: frames.len() });
        }
        let not_finite = |(frame, length): (&[[f64; 4]; 4], &f64)| {
            !length.is_finite() || frame[..3].iter().flatten().any(|x| !x.is_finite())
        };
        if let Some(bone) = frames.iter().zip(lengths).position(not_finite) {
            return Err(Error::UnusableBone { what, bone, problem: "has a rest matrix or length that is not finite" });
        }
        Ok(Self { bones: frames.iter().zip(lengths).map(|(frame, &length)| rest_bone(frame, length)).collect() })
    }

    /// All bones.
    pub fn bones(&self) -> &[RestBone] {
        &self.bones
    }

    fn check_has_size(&self, bone: usize, what: &'static str) -> Result<()> {
        let RestBone { axes, length, .. } = &self.bones[bone];
        if *length <= 0.0 || axes.y_axis == DVec3::ZERO {
            return Err(Error::UnusableBone { what, bone, problem: "has no length" });
        }
        Ok(())
    }
}

/// Gram-Schmidt from Y, so that a frame with scale or shear becomes a rotation. No direction where Y has none.
fn rest_bone(frame: &[[f64; 4]; 4], length: f64) -> RestBone {
    let column = |c: usize| DVec3::new(frame[0][c], frame[1][c], frame[2][c]);
    let y = column(1).normalize_or_zero();
    let mut x = column(0).reject_from(if y == DVec3::ZERO { DVec3::Y } else { y }).normalize_or_zero();
    if x == DVec3::ZERO && y != DVec3::ZERO {
        x = y.any_orthonormal_vector();
    }
    RestBone { head: column(3), axes: DMat3::from_cols(x, y, x.cross(y)), length }
}

/// A bone of the source and a bone of the target that stand for each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BonePair {
    /// Index among the source's bones.
    pub source: u32,
    /// Index among the target's bones.
    pub target: u32,
}

/// Checks `bone_map` (the target's bones), the source's bone for each or a negative number, and returns the pairs.
///
/// # Errors
/// [`Error::LengthMismatch`], [`Error::InvalidParameter`], [`Error::NoCommonBones`], [`Error::UnusableBone`].
pub fn pairs(bone_map: &[i32], source: &Skeleton, target: &Skeleton) -> Result<Vec<BonePair>> {
    let (found, expected) = (bone_map.len(), target.bones.len());
    if found != expected {
        return Err(Error::LengthMismatch { what: "bone_map", found, expected });
    }
    if let Some(&value) = bone_map.iter().find(|&&s| s >= source.bones.len() as i32) {
        let must = "it must name a bone of the source, or be negative for none";
        return Err(Error::InvalidParameter { name: "bone_map", value: f64::from(value), must });
    }
    let pair = |(target, &source): (usize, &i32)| {
        (source >= 0).then_some(BonePair { source: source as u32, target: target as u32 })
    };
    let pairs: Vec<BonePair> = bone_map.iter().enumerate().filter_map(pair).collect();
    if pairs.is_empty() {
        return Err(Error::NoCommonBones);
    }
    for pair in &pairs {
        source.check_has_size(pair.source as usize, "source")?;
        target.check_has_size(pair.target as usize, "target")?;
    }
    Ok(pairs)
}

/// A bone of the source and what stands for it on the target: a bone, or a chain of them taken as one.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// The source's bone.
    pub source: RestBone,
    /// From the head of the first to the tail of the last of `targets`.
    pub target: RestBone,
    /// Indices among the target's bones.
    pub targets: Vec<u32>,
}

/// The guides of `pairs` whose source bone is `weighted` (the source's bones), in the order of first appearance.
pub fn guides(pairs: &[BonePair], source: &Skeleton, target: &Skeleton, weighted: &[bool]) -> Vec<Guide> {
    let mut groups: Vec<(u32, Vec<u32>)> = Vec::new();
    for pair in pairs.iter().filter(|pair| weighted[pair.source as usize]) {
        match groups.iter_mut().find(|group| group.0 == pair.source) {
            Some(group) => group.1.push(pair.target),
            None => groups.push((pair.source, vec![pair.target])),
        }
    }
    let guide = |(bone, targets): (u32, Vec<u32>)| Guide {
        source: source.bones[bone as usize],
        target: united(&targets.iter().map(|&t| target.bones[t as usize]).collect::<Vec<_>>()),
        targets,
    };
    groups.into_iter().map(guide).collect()
}

/// The longest way from a head to a tail along the bones' common direction; one bone is itself.
fn united(bones: &[RestBone]) -> RestBone {
    let common: DVec3 = bones.iter().map(|bone| bone.length * bone.direction()).sum();
    let ways = bones.iter().flat_map(|from| bones.iter().map(move |to| (from, to.tail() - from.head)));
    let (first, way) = ways.max_by(|a, b| a.1.dot(common).total_cmp(&b.1.dot(common))).expect("there is a bone");
    let direction = way.normalize_or_zero();
    if bones.len() == 1 || direction == DVec3::ZERO {
        return bones[0];
    }
    let x = first.axes.x_axis.reject_from(direction).normalize_or_zero();
    let x = if x == DVec3::ZERO { direction.any_orthonormal_vector() } else { x };
    RestBone { head: first.head, axes: DMat3::from_cols(x, direction, x.cross(direction)), length: way.length() }
}
