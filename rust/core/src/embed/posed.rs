//! Where a registration starts: the template's character in the middle of the mesh, and as large, once as it stands and once
//! with its limbs turned as the mesh's are. A registration finds surfaces that are near, not limbs that point elsewhere: a T
//! pose and an A pose are 45 degrees apart.
//!
//! Limbs are found in both bodies by shape alone (`medial`). What that gets wrong it gets wrong alike in both, so that the turn
//! from one to the other is right even where neither is.

use glam::{DMat3, DQuat, DVec3};

use super::medial::{Found, Joint, Reduced};
use super::{Donor, Template, hierarchy};
use crate::error::{Error, Result};
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::welded::Welded;

/// Cells along the diameter of a body; only directions of limbs are wanted.
const RESOLUTION: f64 = 64.0;

/// A limb turns at the last bone below which at least this share of its length lies: an upper arm, not a clavicle.
const PIVOT: f64 = 0.75;

/// Rounds in which turns and the place of the whole adapt to each other.
const ROUNDS: usize = 5;

/// Limbs are longer or shorter than the body's size says by no more than this, either way.
const MOST_STRETCH: f64 = 1.6;

/// The donor and its bones, moved to the mesh.
#[derive(Debug)]
pub(super) struct Start {
    /// Distinct positions (U).
    pub positions: Vec<DVec3>,
    /// Heads and tails of the bones (B).
    pub heads: Vec<[f32; 3]>,
    pub tails: Vec<[f32; 3]>,
}

impl Start {
    /// Moves vertices and bones by the motion of each bone; vertices without weights move with the whole.
    fn new(template: &Template<'_>, donor: &Donor<'_>, body: &Welded, whole: Motion, bones: &[Motion]) -> Self {
        let vertex = |(u, &p): (usize, &DVec3)| {
            let (found, values) = donor.weights.row(body.first[u] as usize);
            let shares = || std::iter::zip(found, values).map(|(&bone, &value)| (bone as usize, f64::from(value)));
            let sum: f64 = shares().map(|(_, value)| value).sum();
            if sum > 0.0 { shares().map(|(j, value)| value / sum * bones[j].point(p)).sum() } else { whole.point(p) }
        };
        let joints = |point: &dyn Fn(usize) -> DVec3| {
            (0..template.len()).map(|j| bones[j].point(point(j)).as_vec3().to_array()).collect()
        };
        Self {
            positions: body.positions.iter().enumerate().map(vertex).collect(),
            heads: joints(&|j| template.head(j)),
            tails: joints(&|j| template.tail(j)),
        }
    }

    /// As the donor stands, moved so that `from` comes to `to`.
    pub fn as_it_is(
        template: &Template<'_>,
        donor: &Donor<'_>,
        body: &Welded,
        scale: f64,
        [from, to]: [DVec3; 2],
    ) -> Self {
        let whole = Motion { turn: DMat3::from_diagonal(DVec3::splat(scale)), step: to - scale * from };
        Self::new(template, donor, body, whole, &vec![whole; template.len()])
    }

    /// With limbs turned as the mesh's. None if the template has no limbs. Reports progress from `span.0` to `span.1`.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn posed(
        template: &Template<'_>,
        donor: &Donor<'_>,
        body: &Welded,
        mesh: &TriMesh<'_>,
        (progress, span): (&Progress, (f64, f64)),
    ) -> Result<Option<Self>> {
        let Ok(reduced) = Reduced::new(template) else { return Ok(None) };
        let middle = 0.5 * (span.0 + span.1);
        let find = |mesh, span| match Found::new(mesh, template, &reduced, RESOLUTION, (progress, span)) {
            Err(Error::Cancelled) => Err(Error::Cancelled),
            found => Ok(found.ok()),
        };
        let (Some(there), Some(here)) = (find(&donor.mesh, (span.0, middle))?, find(mesh, (middle, span.1))?) else {
            return Ok(None);
        };
        let limbs = Limbs::new(template, &reduced, &there, &here);
        Ok(Some(Self::new(template, donor, body, limbs.whole(), &limbs.of_bones(template))))
    }
}

/// An affine motion.
#[derive(Debug, Clone, Copy)]
struct Motion {
    turn: DMat3,
    step: DVec3,
}

impl Motion {
    fn point(&self, p: DVec3) -> DVec3 {
        self.turn * p + self.step
    }
}

/// A limb that ends at an extremity.
struct Limb {
    /// The bone it turns at, and where that is on the template.
    pivot: usize,
    from: DVec3,
    /// The joint at its end.
    joint: usize,
    motion: DMat3,
}

/// How the limbs of the donor turn.
struct Limbs {
    scale: f64,
    step: DVec3,
    limbs: Vec<Limb>,
}

impl Limbs {
    /// `there` and `here` are the joints in the donor and in the mesh.
    fn new(template: &Template<'_>, reduced: &Reduced, there: &Found, here: &Found) -> Self {
        let total = |found: &Found| found.lengths.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let mean = |found: &Found| found.joints().iter().sum::<DVec3>() / found.joints().len() as f64;
        let scale = total(here) / total(there);
        let limbs = pivots(template, reduced, scale);
        let mut posed = Self { scale, step: mean(here) - scale * mean(there), limbs };
        for _ in 0..ROUNDS {
            posed.turn(there.joints(), here.joints());
        }
        posed
    }

    /// Turns each limb to its end in the mesh, then moves the whole to where all joints agree best.
    fn turn(&mut self, there: &[DVec3], here: &[DVec3]) {
        let whole = self.whole();
        let mut moved: Vec<DVec3> = there.iter().map(|&p| whole.point(p)).collect();
        for limb in &mut self.limbs {
            let (old, new) = (there[limb.joint] - limb.from, here[limb.joint] - whole.point(limb.from));
            let stretch = (new.length() / (self.scale * old.length()).max(f64::MIN_POSITIVE))
                .clamp(MOST_STRETCH.recip(), MOST_STRETCH);
            let (old, new) = (old.normalize_or_zero(), new.normalize_or_zero());
            let is_turned = old != DVec3::ZERO && new != DVec3::ZERO;
            let turn = if is_turned { DQuat::from_rotation_arc(old, new) } else { DQuat::IDENTITY };
            limb.motion = DMat3::from_quat(turn) * along(old, stretch) * self.scale;
            moved[limb.joint] = whole.point(limb.from) + limb.motion * (there[limb.joint] - limb.from);
        }
        let off: DVec3 = std::iter::zip(here, &moved).map(|(here, moved)| *here - *moved).sum();
        self.step += off / here.len() as f64;
    }

    fn whole(&self) -> Motion {
        Motion { turn: DMat3::from_diagonal(DVec3::splat(self.scale)), step: self.step }
    }

    /// The motion of each bone: that of the limb whose pivot is above it, or of the whole.
    fn of_bones(&self, template: &Template<'_>) -> Vec<Motion> {
        let whole = self.whole();
        let of_limb =
            |limb: &Limb| Motion { turn: limb.motion, step: whole.point(limb.from) - limb.motion * limb.from };
        let limb_at = |j: usize| self.limbs.iter().find(|limb| limb.pivot == j);
        let parents = hierarchy::parents(template);
        let of_bone = |j: usize| {
            let mut above = Some(j);
            while let Some(bone) = above {
                if let Some(limb) = limb_at(bone) {
                    return of_limb(limb);
                }
                above = parents[bone];
            }
            whole
        };
        (0..template.len()).map(of_bone).collect()
    }
}

/// Stretches along a unit direction and leaves what is across it.
fn along(direction: DVec3, stretch: f64) -> DMat3 {
    let outer = DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
    DMat3::IDENTITY + (stretch - 1.0) * outer
}

fn pivots(template: &Template<'_>, reduced: &Reduced, scale: f64) -> Vec<Limb> {
    let pivot = |(joint, end): (usize, &Joint)| {
        let limb = end.limb.as_ref().filter(|limb| end.is_extremity && !limb.bones.is_empty())?;
        let left = |k: usize| 1.0 - limb.shares[k];
        let at = (0..limb.bones.len()).rev().find(|&k| left(k) >= PIVOT * left(0))?;
        let pivot = limb.bones[at];
        let motion = DMat3::from_diagonal(DVec3::splat(scale));
        Some(Limb { pivot, from: template.head(pivot), joint, motion })
    };
    reduced.joints.iter().enumerate().filter_map(pivot).collect()
}
