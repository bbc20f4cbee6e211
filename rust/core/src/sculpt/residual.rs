//! What weights alone cannot reach.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{Pose, SculptSolver};
use crate::error::Result;

/// A vector for each of some vertices.
#[derive(Debug, Clone, Default)]
pub struct Residuals {
    /// The vertices, ascending.
    pub vertices: Vec<u32>,
    /// One vector each.
    pub vectors: Vec<[f32; 3]>,
}

impl SculptSolver {
    /// From every vertex sculpted in a pose to its target there, in pose space.
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] if the pose is not there.
    pub fn residuals(&self, pose: usize) -> Result<Residuals> {
        self.map_sculpted(pose, |_, _, residual| residual)
    }

    /// The same taken back to rest space through the blended transform T, T^-1 r: the offsets of a corrective shape
    /// key that, driven by the pose, makes up for what the weights cannot do.
    ///
    /// Where the blend of the bones has collapsed, the shortest offset that does most of the work (damped inverse).
    ///
    /// # Errors
    /// [`crate::Error::InvalidParameter`] if the pose is not there.
    pub fn rest_residuals(&self, pose: usize) -> Result<Residuals> {
        self.map_sculpted(pose, |i, pose, residual| damped_inverse(self.transform(i, pose).matrix3) * residual)
    }

    fn map_sculpted(&self, pose: usize, map: impl Fn(usize, &Pose, DVec3) -> DVec3 + Sync) -> Result<Residuals> {
        let (number, pose) = (pose, self.pose(pose)?);
        let one = |(i, targets): (usize, &Vec<super::Target>)| {
            let target = targets.iter().find(|t| t.pose == number)?;
            let vector = map(i, pose, residual(self, pose, i, target.position));
            Some((i as u32, vector.as_vec3().to_array()))
        };
        let (vertices, vectors) = self
            .targets
            .par_iter()
            .enumerate()
            .with_min_len(1024)
            .filter_map(one)
            .collect::<Vec<_>>()
            .into_iter()
            .unzip();
        Ok(Residuals { vertices, vectors })
    }
}

pub(super) fn residual(solver: &SculptSolver, pose: &Pose, i: usize, target: DVec3) -> DVec3 {
    target - solver.transform(i, pose).transform_point3(solver.rest[i])
}

pub(super) fn reachability(before: &[DVec3], after: &[DVec3]) -> f64 {
    let norm = |residuals: &[DVec3]| residuals.iter().map(|r| r.length_squared()).sum::<f64>().sqrt();
    let before = norm(before);
    if before > 0.0 { 1.0 - norm(after) / before } else { 1.0 }
}

/// The inverse, or (M'M + damping)^-1 M' where M is nearly singular against its own size; zero where nothing of M is left, as
/// of a bone that is scaled to zero.
fn damped_inverse(m: DMat3) -> DMat3 {
    let size = (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()) / 3.0;
    if m.determinant().abs() > 1e-3 * size.powf(1.5) {
        return m.inverse();
    }
    if size == 0.0 {
        return DMat3::ZERO;
    }
    let damped = m.transpose() * m + DMat3::from_diagonal(DVec3::splat(1e-2 * size));
    damped.inverse() * m.transpose()
}
