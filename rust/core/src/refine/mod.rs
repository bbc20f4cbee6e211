//! Skin refinement: extended position-based dynamics around the joints that a pose bends or twists.
//!
//! N. H. Abu Rumman, M. Fratarcangeli: Position-based skinning for soft articulated characters (Computer Graphics Forum
//! 34(6), 2015), extended. A frame starts at rest and walks to its pose in sub-angles: the path decides, not the
//! convergence, for two hundred iterations from the skinned shape leave a hundred pairs of triangles in each other where
//! a walk from rest leaves none. No frame depends on another.

mod balloon;
mod clock;
mod constraint;
mod contact;
mod coupling;
mod crease;
mod figures;
mod finish;
mod frame;
mod harm;
mod holes;
mod joints;
mod lattice;
mod limiting;
mod local;
mod membrane;
mod morton;
mod node_weights;
mod number;
mod pairs;
mod predictor;
mod prepared;
mod projection;
mod region;
mod report;
mod settings;
mod size;
mod skeleton;
mod skin;
mod solver;
mod surface;
#[cfg(test)]
mod tests;
mod unfold;
mod whole;

use glam::{DAffine3, Vec3};

use self::contact::Effort;
pub use self::pairs::intersecting_pairs;
use self::pairs::{Slabs, Suspects};
use self::prepared::Prepared;
pub use self::projection::Kernel;
pub use self::report::{JointMeasure, JointReport, Report};
pub use self::settings::{Quality, Settings};
use self::solver::Work;
use crate::error::Result;
use crate::mesh::TriMesh;
use crate::progress::Progress;
use crate::skinning::{check_length, dual_quaternion_blend};
use crate::weights::Weights;

/// The volume that may be missing once limbs are kept apart, as a share of all of it.
const MOST_LOST: f64 = 0.02;
/// And what keeping them apart may cost where more than that is missing already.
const MOST_COST: f64 = 0.005;

/// A character prepared for refinement: any number of poses, in any order.
///
/// # Example
/// An elbow bent by 120 degrees:
/// ```
/// use glam::{DAffine3, DQuat, DVec3};
/// use skinwright_core::refine::{Quality, Refiner, Settings};
/// use skinwright_core::{Progress, TriMesh};
/// # include!(concat!(env!("CARGO_MANIFEST_DIR"), "/examples/read/mod.rs"));
/// # fn main() -> Result<(), Box<dyn AnyError>> {
/// # let (positions, triangles) = mesh(data("arm.obj"))?;
/// # let painted = weights(data("arm.weights"), positions.len())?;
/// let arm = TriMesh::new(&positions, &triangles, "arm")?;
/// let segments = [[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]], [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0]]];
/// let settings = Settings { cell: Some(0.03), ..Settings::default() };
/// let refiner = Refiner::new(&arm, &painted, &[-1, 0], &segments, settings, &Progress::default())?;
/// let elbow = DAffine3::from_translation(DVec3::new(0.5, 0.0, 0.0));
/// let bend = elbow * DAffine3::from_quat(DQuat::from_rotation_z(120f64.to_radians())) * elbow.inverse();
/// let refined = refiner.solve(&[DAffine3::IDENTITY, bend], Quality::Live)?;
/// assert_eq!(refined.len(), positions.len());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Refiner {
    prepared: Prepared,
    settings: Settings,
    rest_positions: Vec<[f32; 3]>,
    weights: Weights,
}

impl Refiner {
    /// Builds the lattice around `mesh` (rest, mesh units) and finds the joints of its bones: `parents` (B,), negative for a
    /// root, and `segments` (B, 2, 3), head and tail at rest.
    ///
    /// # Errors
    /// [`crate::Error::NothingInside`] where no tetrahedron lies inside, [`crate::Error::TooManyVertices`],
    /// [`crate::Error::InvalidParameter`], [`crate::Error::LengthMismatch`], [`crate::Error::WeightNegative`] and
    /// [`crate::Error::Cancelled`].
    pub fn new(
        mesh: &TriMesh<'_>,
        weights: &Weights,
        parents: &[i32],
        segments: &[[[f64; 3]; 2]],
        settings: Settings,
        progress: &Progress,
    ) -> Result<Self> {
        settings.check()?;
        let prepared = Prepared::new(mesh, weights, parents, segments, &settings, progress)?;
        Ok(Self { prepared, settings, rest_positions: mesh.positions().to_vec(), weights: weights.clone() })
    }

    /// Refined positions (V, 3) of a pose, one transform per bone.
    ///
    /// Vertices away from the joints that turn are where dual quaternions put them.
    ///
    /// # Errors
    /// [`crate::Error::LengthMismatch`] if the pose has another number of bones.
    pub fn solve(&self, pose_from_rest: &[DAffine3], quality: Quality) -> Result<Vec<[f32; 3]>> {
        Ok(self.run(pose_from_rest, quality, Kernel::Lanes, false)?.0)
    }

    /// The same with figures, and with a kernel of choice, which does not change the bits.
    ///
    /// # Errors
    /// As [`Refiner::solve`].
    pub fn solve_with_report(
        &self,
        pose_from_rest: &[DAffine3],
        quality: Quality,
        kernel: Kernel,
    ) -> Result<(Vec<[f32; 3]>, Report)> {
        let (positions, mut report) = self.run(pose_from_rest, quality, kernel, true)?;
        let surface = &self.prepared.surface;
        let count = |positions: &[[f32; 3]]| {
            let places: Vec<[f32; 3]> = surface.source.iter().map(|&i| positions[i as usize]).collect();
            intersecting_pairs(&places, &surface.triangles).len()
        };
        report.pairs_at_rest = count(&self.rest_positions);
        report.pairs_before = count(&self.skinned(pose_from_rest)?);
        report.pairs_after = count(&positions);
        Ok((positions, report))
    }

    /// Pairs of triangles that intersect, and figures of every joint that turns, for skin that anybody put at `positions`
    /// (V, 3) in this pose.
    ///
    /// # Errors
    /// [`crate::Error::LengthMismatch`] if positions or bones are of another number.
    pub fn measure(&self, pose_from_rest: &[DAffine3], positions: &[[f32; 3]]) -> Result<(usize, Vec<JointMeasure>)> {
        check_length("positions", positions.len(), self.rest_positions.len())?;
        check_length("pose_from_rest", pose_from_rest.len(), self.weights.n_bones() as usize)?;
        let size = size::of_body(&self.prepared.joints, pose_from_rest);
        let pose = size::without(size, pose_from_rest);
        let surface = &self.prepared.surface;
        let mut welded: Vec<[f32; 3]> = surface.source.iter().map(|&i| positions[i as usize]).collect();
        size::scale(&mut welded, 1.0 / size);
        let in_cells =
            |&place: &[f32; 3]| ((Vec3::from(place).as_dvec3() - self.prepared.middle) / self.prepared.cell).as_vec3();
        let places: Vec<Vec3> = welded.iter().map(in_cells).collect();
        let joints = figures::measure(&self.prepared, &self.settings, &self.prepared.in_cells(&pose), &places);
        Ok((intersecting_pairs(&welded, &surface.triangles).len(), joints))
    }

    fn run(
        &self,
        pose_from_rest: &[DAffine3],
        quality: Quality,
        kernel: Kernel,
        with_figures: bool,
    ) -> Result<(Vec<[f32; 3]>, Report)> {
        let start = std::time::Instant::now();
        check_length("pose_from_rest", pose_from_rest.len(), self.weights.n_bones() as usize)?;
        let size = size::of_body(&self.prepared.joints, pose_from_rest);
        let pose = size::without(size, pose_from_rest);
        let mut positions = self.skinned(&pose)?;
        let skinned = start.elapsed().as_secs_f64() * 1e3;
        let pose = self.prepared.in_cells(&pose);
        let work = Work { quality, kernel, with_figures };
        let mut solution = solver::solve(&self.prepared, &self.settings, &pose, &positions, work);
        let mut place = vec![None; self.prepared.surface.len()];
        solution.moved.iter().for_each(|&(vertex, at)| place[vertex as usize] = Some(self.prepared.in_mesh(at)));
        for (position, &welded) in positions.iter_mut().zip(&self.prepared.surface.of_vertex) {
            // A pose that mirrors or flattens a joint may have no answer there: skinning has one.
            if let Some(at) = place[welded as usize].filter(|at| at.is_finite()) {
                *position = at.to_array();
            }
        }
        if self.settings.self_collision && quality == Quality::Bake {
            let start = std::time::Instant::now();
            self.part_limbs(&mut positions, &solution.slabs);
            solution.report.stages.push(("limbs", start.elapsed().as_secs_f64() * 1e3));
        }
        solution.report.stages.insert(0, ("skin", skinned));
        size::scale(&mut positions, size);
        Ok((positions, solution.report))
    }

    /// Limb against limb, limb against torso: over the whole skin. Regions are looked at once more, as rounding from cells to
    /// mesh units lets triangles intersect that touched.
    fn part_limbs(&self, positions: &mut [[f32; 3]], slabs: &Slabs) {
        let surface = &self.prepared.surface;
        let mut places: Vec<Vec3> = surface.source.iter().map(|&i| positions[i as usize].into()).collect();
        let triangles: Vec<u32> = (0..surface.triangles.len() as u32).collect();
        let suspects = Suspects::all_of(&triangles);
        let farthest = solver::FARTHEST * self.prepared.cell as f32;
        let effort = Effort { farthest, rounds: Quality::Bake.rounds() };
        let before = places.clone();
        if self.prepared.contact.part(surface, &mut places, suspects, effort, slabs).0.is_empty() {
            return;
        }
        // Layers of cloth can be smoothed away; they had better pass through each other.
        if self.lost(&places) > MOST_LOST.max(self.lost(&before) + MOST_COST) {
            return;
        }
        for (position, &welded) in positions.iter_mut().zip(&surface.of_vertex) {
            let at = places[welded as usize];
            if at.is_finite() {
                *position = at.to_array();
            }
        }
    }

    /// By how much the volume of the skin at `places` (welded) differs from rest, as a share.
    fn lost(&self, places: &[Vec3]) -> f64 {
        let surface = &self.prepared.surface;
        let now: f64 = surface.volumes(|i| places[i as usize].as_dvec3()).iter().sum();
        let at_rest: f64 = surface.volumes(|i| surface.rest[i as usize]).iter().sum();
        (now / at_rest - 1.0).abs()
    }

    /// Positions (V, 3) of a pose by dual quaternions alone.
    ///
    /// # Errors
    /// As [`Refiner::solve`].
    pub fn skinned(&self, pose_from_rest: &[DAffine3]) -> Result<Vec<[f32; 3]>> {
        dual_quaternion_blend(&self.rest_positions, &self.weights, pose_from_rest, None)
    }
}
