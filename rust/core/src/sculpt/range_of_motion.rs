//! Guard poses where an animation is missing.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::SculptSolver;
use super::checks::check_length;
use crate::error::{Error, Result};

/// Turns of a joint that a character takes sooner or later, in degrees.
const TURNS: [f64; 4] = [-90.0, -45.0, 45.0, 90.0];

impl SculptSolver {
    /// Guards the turns of some joints: bone and everything below it by +-45 and +-90 degrees about each axis of the
    /// mesh' space through the bone's head. The turns of one joint share `alpha`.
    ///
    /// `parents` (B) are negative for roots, `heads` (B, 3) are in the mesh' space, `joints` are bones.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::InvalidParameter`] for a joint that is not there.
    pub fn guard_range_of_motion(
        &mut self,
        parents: &[i32],
        heads: &[[f32; 3]],
        joints: &[u32],
        alpha: f64,
    ) -> Result<()> {
        check_length("bone_parents", parents.len(), self.locked.len())?;
        check_length("bone_heads", heads.len(), self.locked.len())?;
        if let Some(&joint) = joints.iter().find(|&&j| j as usize >= parents.len()) {
            return Err(Error::InvalidParameter { name: "joint", value: joint.into(), must: "there is no such bone" });
        }
        for &joint in joints {
            let poses = turns(parents, Vec3::from(heads[joint as usize]).as_dvec3(), joint as usize);
            for pose in &poses {
                self.guard(pose, alpha / poses.len() as f64)?;
            }
        }
        Ok(())
    }
}

fn turns(parents: &[i32], head: DVec3, joint: usize) -> Vec<Vec<DAffine3>> {
    let turns_along: Vec<bool> = (0..parents.len()).map(|bone| is_below(parents, bone, joint)).collect();
    let pose = |axis: DVec3, degrees: f64| {
        let matrix3 = DMat3::from_axis_angle(axis, degrees.to_radians());
        let turned = DAffine3 { matrix3, translation: head - matrix3 * head };
        turns_along.iter().map(|&turns| if turns { turned } else { DAffine3::IDENTITY }).collect()
    };
    DVec3::AXES.iter().flat_map(|&axis| TURNS.map(|degrees| pose(axis, degrees))).collect()
}

/// Whether `bone` is `ancestor` or hangs below it.
fn is_below(parents: &[i32], bone: usize, ancestor: usize) -> bool {
    let parent = |&bone: &usize| parents.get(bone).and_then(|&p| usize::try_from(p).ok());
    std::iter::successors(Some(bone), parent).take(parents.len()).any(|b| b == ancestor)
}
