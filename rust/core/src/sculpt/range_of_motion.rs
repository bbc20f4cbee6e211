//! Guard poses where an animation is missing.

use glam::{DAffine3, DMat3, DVec3};

/// Turns of a joint that a character will take sooner or later, in degrees.
const TURNS: [f64; 4] = [-90.0, -45.0, 45.0, 90.0];

/// One pose a turn of bone `joint` about each axis of the mesh' space through its `head`: the bone and everything
/// below it turns, the rest stands still. `parents` (B) are negative for roots.
pub fn range_of_motion(parents: &[i32], head: [f32; 3], joint: usize) -> Vec<Vec<DAffine3>> {
    let head = DVec3::from(head.map(f64::from));
    let turns_along: Vec<bool> = (0..parents.len()).map(|bone| is_below(parents, bone, joint)).collect();
    let pose = |axis: DVec3, degrees: f64| {
        let matrix3 = DMat3::from_axis_angle(axis, degrees.to_radians());
        let turned = DAffine3 { matrix3, translation: head - matrix3 * head };
        turns_along.iter().map(|&turns| if turns { turned } else { DAffine3::IDENTITY }).collect()
    };
    DVec3::AXES.iter().flat_map(|&axis| TURNS.map(|degrees| pose(axis, degrees))).collect()
}

fn is_below(parents: &[i32], bone: usize, ancestor: usize) -> bool {
    let parent = |&b: &usize| parents.get(b).and_then(|&p| usize::try_from(p).ok());
    std::iter::successors(Some(bone), parent).take(parents.len()).any(|b| b == ancestor)
}
