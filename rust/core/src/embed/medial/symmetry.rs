//! Mirror symmetry of mesh and template, about a plane across one of the axes.

use glam::DVec3;

use super::super::Template;
use super::reduced::Reduced;
use crate::adjacency::NONE;
use crate::inside::Lattice;
use crate::mesh::TriMesh;

/// How far off its image a joint may be, as a share of the skeleton's size.
const NEAR: f64 = 0.02;

/// Share of the bones that have an image.
const MOST_BONES: f64 = 0.8;

/// Share of the inside of the mesh whose image is inside.
const SAME: f64 = 0.9;

/// Where something lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Plane,
    Positive,
    Negative,
}

/// A template that is its own mirror image.
#[derive(Debug)]
pub(super) struct Images {
    axis: usize,
    middle: f64,
    /// How far off an image may be.
    near: f64,
    /// The image of each bone, [`NONE`] where it has none.
    of_bone: Vec<u32>,
}

impl Images {
    pub(super) fn new(template: &Template<'_>) -> Option<Self> {
        (0..3).find_map(|axis| Self::about(axis, template))
    }

    fn about(axis: usize, template: &Template<'_>) -> Option<Self> {
        let heads: Vec<DVec3> = (0..template.len()).map(|j| template.head(j)).collect();
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = heads.iter().fold(empty, |(low, high), &p| (low.min(p), high.max(p)));
        let (middle, near) = (0.5 * (low[axis] + high[axis]), NEAR * low.distance(high));
        let image = |p: DVec3| mirrored(p, axis, middle);
        let apart = |j: usize, other: usize| {
            let tails = template.tail(other).distance(image(template.tail(j)));
            heads[other].distance(image(heads[j])).max(tails)
        };
        let nearest = |j: usize| {
            let others = (0..heads.len()).map(|other| (other as u32, apart(j, other)));
            others.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|&(_, distance)| distance < near)
        };
        let of_bone: Vec<u32> = (0..heads.len()).map(|j| nearest(j).map_or(NONE, |(other, _)| other)).collect();
        let found = of_bone.iter().filter(|&&other| other != NONE).count();
        let is_pair = |(j, &other): (usize, &u32)| other != NONE && other as usize != j && apart(j, j) > near;
        let has_pairs = of_bone.iter().enumerate().any(is_pair);
        let is_symmetric = has_pairs && found as f64 >= MOST_BONES * heads.len() as f64;
        is_symmetric.then_some(Self { axis, middle, near, of_bone })
    }

    /// Whether bone `j` lies on the plane.
    pub(super) fn is_on_plane(&self, j: usize) -> bool {
        self.of_bone[j] as usize == j
    }
}

fn mirrored(mut p: DVec3, axis: usize, middle: f64) -> DVec3 {
    p[axis] = 2.0 * middle - p[axis];
    p
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
    /// None unless mesh and reduced template are both their own images.
    pub(super) fn new(images: Images, reduced: &Reduced, mesh: &TriMesh<'_>, lattice: &Lattice) -> Option<Self> {
        let Images { axis, middle, near, of_bone } = images;
        let joints: Vec<DVec3> = reduced.joints.iter().map(|joint| joint.position).collect();
        let partner = |&p: &DVec3| {
            let distances = joints.iter().map(|q| q.distance(mirrored(p, axis, middle))).enumerate();
            distances.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|&(_, distance)| distance < near)
        };
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
        let used = || mesh.triangles().as_flattened().iter().map(|&i| mesh.position(i)[axis]);
        let (low, high) = used().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        let middle = 0.5 * (low + high);
        let is_same =
            |&node: &u32| lattice.is_near_node(lattice.cells().place(mirrored(lattice.middle(node), axis, middle)));
        let same = (0..lattice.len() as u32).filter(is_same).count();
        let tolerance = 0.75 * lattice.cells().size();
        let symmetry = Self { axis, middle, tolerance, side, joint_image, bone_image: of_bone };
        (same as f64 >= SAME * lattice.len() as f64).then_some(symmetry)
    }

    /// The image of a point of the mesh.
    pub(super) fn image(&self, p: DVec3) -> DVec3 {
        mirrored(p, self.axis, self.middle)
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
