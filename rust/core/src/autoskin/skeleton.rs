//! Bones at rest.

use glam::{DVec3, Vec3};

use crate::bones::parents_first;
use crate::error::{Error, Result};
use crate::mesh::TriMesh;

/// How far out bones may lie, as a share of the mesh's diagonal and the skeleton's together, before the two seem to be in
/// different spaces. A button may well be smaller than its distance from the next bone.
const FAR: f64 = 0.5;

/// Bones at rest in the mesh's space.
#[derive(Debug, Clone, Copy)]
pub struct Skeleton<'a> {
    /// Head and tail of each bone, (B).
    pub segments: &'a [[[f32; 3]; 2]],
    /// Parent of each bone, negative for a root, (B).
    pub parents: &'a [i32],
}

impl Skeleton<'_> {
    /// Number of bones.
    pub fn len(&self) -> usize {
        self.segments.len()
    }

    /// Whether there is no bone.
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// Parent of bone `j`.
    pub fn parent(&self, j: usize) -> Option<usize> {
        usize::try_from(self.parents[j]).ok()
    }

    /// Head and tail of bone `j`.
    pub fn segment(&self, j: usize) -> [DVec3; 2] {
        self.segments[j].map(|p| Vec3::from(p).as_dvec3())
    }

    /// Length of bone `j`.
    pub fn length(&self, j: usize) -> f64 {
        let [head, tail] = self.segment(j);
        head.distance(tail)
    }

    /// The point of bone `j` nearest to `point`.
    pub fn closest_point(&self, j: usize, point: DVec3) -> DVec3 {
        let [head, tail] = self.segment(j);
        let along = tail - head;
        let share = (point - head).dot(along) / along.length_squared().max(f64::MIN_POSITIVE);
        head + share.clamp(0.0, 1.0) * along
    }

    /// # Errors
    /// [`Error::InvalidSkeleton`] if there are no bones, or one is not finite, has no length or an impossible parent, or if all
    /// lie far from the mesh.
    pub fn check(&self, mesh: &TriMesh<'_>) -> Result<()> {
        let invalid = |reason: String| Err(Error::InvalidSkeleton { reason });
        if self.is_empty() {
            return invalid("there are no bones; give the armature at least one deforming bone".into());
        }
        if self.parents.len() != self.len() {
            return invalid(format!("{} bones have {} parents", self.len(), self.parents.len()));
        }
        for j in 0..self.len() {
            if !self.segments[j].as_flattened().iter().all(|x| x.is_finite()) {
                return invalid(format!("bone {j} has a head or tail that is not finite"));
            }
            if self.length(j) == 0.0 {
                return invalid(format!("bone {j} has no length; move its tail away from its head, or leave it out"));
            }
        }
        if let Err(j) = parents_first(self.parents) {
            return invalid(format!("the parents of bone {j} lead in a circle or to a bone that is not there"));
        }
        if self.is_far_from(mesh) {
            let advice = "apply the scale of both, or move the armature into the mesh";
            return invalid(format!("all bones lie outside of the mesh's bounding box; {advice}"));
        }
        Ok(())
    }

    fn is_far_from(&self, mesh: &TriMesh<'_>) -> bool {
        let (low, high) = bounds(mesh.triangles().as_flattened().iter().map(|&i| mesh.position(i)));
        let (lowest, highest) = bounds((0..self.len()).flat_map(|j| self.segment(j)));
        let margin = FAR * (low.distance(high) + lowest.distance(highest));
        let near = |p: DVec3| p.cmpge(low - margin).all() && p.cmple(high + margin).all();
        let middle = 0.5 * (low + high);
        (0..self.len()).all(|j| !near(self.closest_point(j, middle)) && !self.segment(j).into_iter().any(near))
    }
}

fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}
