//! Mirror symmetry of mesh and template, about a plane across one of the axes.

use glam::DVec3;

use super::super::Template;
use super::reduced::Reduced;
use crate::adjacency::NONE;
use crate::inside::Lattice;
use crate::mesh::TriMesh;

/// How far off its image a joint may be, as a share of the skeleton's size.
const NEAR: f64 = 0.02;

/// Share of the inside of the mesh whose image is inside.
const SAME: f64 = 0.9;

/// Where something lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Plane,
    Positive,
    Negative,
}

/// A mesh and a template that are their own mirror images.
#[derive(Debug)]
pub(super) struct Symmetry {
    axis: usize,
    /// The plane's coordinate in the mesh's space.
    middle: f64,
    /// Half of the thickness of what counts as on the plane.
    tolerance: f64,
    /// Side of each reduced joint.
    pub(super) side: Vec<Side>,
    /// The image of each reduced joint and of each bone, [`NONE`] where a bone has none.
    pub(super) joint_image: Vec<usize>,
    pub(super) bone_image: Vec<u32>,
}

impl Symmetry {
    pub(super) fn new(
        template: &Template<'_>,
        reduced: &Reduced,
        mesh: &TriMesh<'_>,
        lattice: &Lattice,
    ) -> Option<Self> {
        (0..3).find_map(|axis| Self::about(axis, template, reduced, mesh, lattice))
    }

    fn about(
        axis: usize,
        template: &Template<'_>,
        reduced: &Reduced,
        mesh: &TriMesh<'_>,
        lattice: &Lattice,
    ) -> Option<Self> {
        let joints: Vec<DVec3> = reduced.joints.iter().map(|joint| joint.position).collect();
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = joints.iter().fold(empty, |(low, high), &p| (low.min(p), high.max(p)));
        let (middle, near) = (0.5 * (low[axis] + high[axis]), NEAR * low.distance(high));
        let image = |mut p: DVec3, middle: f64| {
            p[axis] = 2.0 * middle - p[axis];
            p
        };
        let partner = |&p: &DVec3| nearest(&joints, image(p, middle)).filter(|&(_, distance)| distance < near);
        let joint_image: Vec<usize> = joints.iter().map(|p| partner(p).map(|(k, _)| k)).collect::<Option<_>>()?;
        if joint_image.iter().enumerate().any(|(k, &other)| joint_image[other] != k) {
            return None;
        }
        let side = |(k, p): (usize, &DVec3)| match joint_image[k] {
            other if other == k => Side::Plane,
            _ if p[axis] > middle => Side::Positive,
            _ => Side::Negative,
        };
        let side: Vec<Side> = joints.iter().enumerate().map(side).collect();
        if side.iter().all(|&side| side == Side::Plane) || !keeps_limbs(reduced, &joint_image, &side) {
            return None;
        }
        let used = || mesh.triangles().as_flattened().iter().map(|&i| mesh.position(i)[axis]);
        let (low, high) = used().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        let in_mesh = 0.5 * (low + high);
        let is_same = |&node: &u32| {
            let place = lattice.cells().place(image(lattice.middle(node), in_mesh));
            lattice.is_near_node(place)
        };
        let same = (0..lattice.len() as u32).filter(is_same).count();
        if (same as f64) < SAME * lattice.len() as f64 {
            return None;
        }
        let heads: Vec<DVec3> = (0..template.len()).map(|j| template.head(j)).collect();
        let bone_image = |j: usize| {
            let found = (0..heads.len()).filter(|&other| {
                let (head, tail) = (image(heads[j], middle), image(template.tail(j), middle));
                heads[other].distance(head) < near && template.tail(other).distance(tail) < near
            });
            let apart = |&other: &usize| heads[other].distance(image(heads[j], middle));
            found.min_by(|a, b| apart(a).total_cmp(&apart(b))).map_or(NONE, |other| other as u32)
        };
        let bone_image = (0..heads.len()).map(bone_image).collect();
        let tolerance = 0.75 * lattice.cells().size();
        Some(Self { axis, middle: in_mesh, tolerance, side, joint_image, bone_image })
    }

    /// The image of a point of the mesh.
    pub(super) fn image(&self, mut p: DVec3) -> DVec3 {
        p[self.axis] = 2.0 * self.middle - p[self.axis];
        p
    }

    /// The nearest point on the plane.
    pub(super) fn on_plane(&self, mut p: DVec3) -> DVec3 {
        p[self.axis] = self.middle;
        p
    }

    /// Where a point of the mesh lies; an extremity is farther off the plane by chance than a place chosen for it.
    pub(super) fn side_of(&self, p: DVec3, is_extremity: bool) -> Side {
        let tolerance = if is_extremity { 3.0 * self.tolerance } else { self.tolerance };
        match p[self.axis] - self.middle {
            x if x.abs() <= tolerance => Side::Plane,
            x if x > 0.0 => Side::Positive,
            _ => Side::Negative,
        }
    }
}

/// Whether limbs are mapped to limbs, and none crosses the plane: a chain along the axis is its own image, but turned about.
fn keeps_limbs(reduced: &Reduced, image: &[usize], side: &[Side]) -> bool {
    let from = |k: usize| reduced.joints[k].limb.as_ref().map(|limb| limb.from);
    let crosses = |k: usize| side[k] == Side::Positive && from(k).is_some_and(|k| side[k] == Side::Negative);
    (0..image.len()).all(|k| from(k).map(|from| image[from]) == from(image[k]) && !crosses(k))
}

fn nearest(points: &[DVec3], to: DVec3) -> Option<(usize, f64)> {
    let distances = points.iter().map(|p| p.distance(to)).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1))
}
