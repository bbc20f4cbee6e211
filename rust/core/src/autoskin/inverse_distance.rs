//! Weights from inverse distances: w_j = d_j^-4 over the sum of all, d the distance to the bone (J. Pan, L. Chen, Y. Yang,
//! H. Qin: Automatic skinning and weight retargeting of articulated characters using extended position-based dynamics. The
//! Visual Computer, 2017, Eq. 2).
//!
//! The paper takes three bones near a joint (its two and the nearest other) and two elsewhere, which jumps where a vertex
//! changes sides. Mended: from each d_j^-4 that of the first bone left out is subtracted, so that a bone comes and goes with
//! weight zero; and the two sets are blended over the joint's radius, half of the shorter of its two bones.

use glam::DVec3;

use super::candidates::Candidates;
use super::rows;
use super::skeleton::Skeleton;
use crate::mesh::TriMesh;
use crate::weights::Weights;

/// Bones are no nearer than this share of the mesh's diagonal.
const LEAST_DISTANCE: f64 = 1e-4;

/// Radius of a joint's region in shorter bones.
const RADIUS: f64 = 0.5;

/// A bone and its distance.
type Near = (u32, f64);

/// From straight distances.
pub(super) fn euclidean(mesh: &TriMesh<'_>, skeleton: &Skeleton<'_>) -> Weights {
    let distances = |i: usize, out: &mut Vec<Near>| {
        let position = mesh.position(i as u32);
        out.extend((0..skeleton.len()).map(|j| (j as u32, position.distance(skeleton.closest_point(j, position)))));
    };
    weights(mesh, skeleton, distances)
}

/// From distances through the inside of the mesh.
pub(super) fn geodesic(mesh: &TriMesh<'_>, skeleton: &Skeleton<'_>, candidates: &Candidates) -> Weights {
    weights(mesh, skeleton, |i, out| out.extend(candidates.of(i).iter().map(|c| (c.bone, c.distance))))
}

fn weights(mesh: &TriMesh<'_>, skeleton: &Skeleton<'_>, distances: impl Fn(usize, &mut Vec<Near>) + Sync) -> Weights {
    let joints = joints(skeleton);
    let least = (LEAST_DISTANCE * mesh.diagonal()).max(f64::MIN_POSITIVE);
    let row = |near: &mut Vec<Near>, i: usize, out: &mut Vec<(u32, f32)>| {
        near.clear();
        distances(i, near);
        near.iter_mut().for_each(|(_, distance)| *distance = distance.max(least));
        near.sort_by(|x, y| x.1.total_cmp(&y.1).then(x.0.cmp(&y.0)));
        rows::append(blend(near, &joints, mesh.position(i as u32)), out);
    };
    Weights::from_rows(mesh.vertex_count(), skeleton.len() as u32, Vec::new, row)
}

/// Where a bone meets its parent.
struct Joint {
    position: DVec3,
    radius: f64,
    bones: [u32; 2],
}

fn joints(skeleton: &Skeleton<'_>) -> Vec<Joint> {
    let joint = |j: usize| {
        let parent = skeleton.parent(j)?;
        let radius = RADIUS * skeleton.length(j).min(skeleton.length(parent));
        Some(Joint { position: skeleton.segment(j)[0], radius, bones: [parent as u32, j as u32] })
    };
    (0..skeleton.len()).filter_map(joint).collect()
}

/// The row of a vertex, whose bones are `near`, nearest first.
fn blend(near: &[Near], joints: &[Joint], position: DVec3) -> Vec<Near> {
    let mut row: Vec<Near> = near.iter().map(|&(bone, _)| (bone, 0.0)).collect();
    let mut elsewhere = 1.0;
    for joint in joints {
        let outward = position.distance(joint.position) / joint.radius;
        if outward < 1.0 {
            // 1 with slope 0 at the joint, 0 with slope 0 at the border.
            let share = 1.0 - outward * outward * (3.0 - 2.0 * outward);
            elsewhere = f64::max(0.0, elsewhere - share);
            add(&mut row, near, share, |bone| joint.bones.contains(&bone), 1);
        }
    }
    add(&mut row, near, elsewhere, |_| false, 2);
    row.retain(|&(_, value)| value > 0.0);
    row
}

/// Adds `share` of the weights of the bones that are `always` taken and of `others` more, the nearest.
fn add(row: &mut [Near], near: &[Near], share: f64, always: impl Fn(u32) -> bool, others: usize) {
    let power = |distance: f64| (near[0].1 / distance).powi(4);
    let rest = || near.iter().filter(|&&(bone, _)| !always(bone));
    let left_out = rest().nth(others).map_or(0.0, |&(_, distance)| power(distance));
    let last = rest().nth(others - 1).map_or(f64::INFINITY, |&(_, distance)| distance);
    let value = |&(bone, distance): &Near| match () {
        () if always(bone) => power(distance),
        () if distance <= last => power(distance) - left_out,
        () => 0.0,
    };
    let sum: f64 = near.iter().map(value).sum();
    // All are equally far where nothing is left after the subtraction.
    let value = |bone: &Near| if sum > 0.0 { value(bone) / sum } else { f64::from(u8::from(bone.1 <= last)) };
    row.iter_mut().zip(near).for_each(|(entry, near)| entry.1 += share * value(near));
}
