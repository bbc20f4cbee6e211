//! The rest shape as further unknowns, the last idea of the thesis (chapter 9).

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::{MAX_MEMBERS, SculptSolver};
use crate::error::{Error, Result};
use crate::skinning::blended_transform;
use crate::weights::Weights;

/// Weights and rest positions that together meet the sculpts of some vertices.
#[derive(Debug, Clone)]
pub struct RestShape {
    /// What to add to each rest position.
    pub offsets: Vec<[f32; 3]>,
    /// One row for each of the vertices.
    pub weights: Weights,
}

impl SculptSolver {
    /// Minimises sum_p alpha_p |T_p(w)(v + delta) - t_p|^2 + `stiffness` |delta|^2 over weights w and offset delta of
    /// each of `vertices`, in turns, `rounds` times. Guards hold the weights as they do in strokes.
    ///
    /// Nothing is changed in the solver. A vertex sculpted in fewer than two poses keeps its weights and gets no
    /// offset: one pose alone would take it all the way by the offset.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a vertex that is not there or `stiffness` <= 0.
    pub fn fit_rest_shape(&self, vertices: &[u32], stiffness: f64, rounds: usize) -> Result<RestShape> {
        self.check_vertices(vertices)?;
        if !(stiffness > 0.0 && stiffness.is_finite()) {
            let must = "it must be more than 0, for instance 0.1";
            return Err(Error::InvalidParameter { name: "stiffness", value: stiffness, must });
        }
        let fit = |&i: &u32| self.fit_vertex(i as usize, stiffness, rounds);
        let (offsets, rows): (Vec<_>, Vec<_>) = vertices.par_iter().with_min_len(64).map(fit).unzip();
        Ok(RestShape { offsets, weights: self.rows_of(vertices, |k, _| rows[k].as_slice()) })
    }

    fn fit_vertex(&self, i: usize, stiffness: f64, rounds: usize) -> ([f32; 3], [f32; MAX_MEMBERS]) {
        let (bones, values) = self.row(i);
        let mut row = [0.0; MAX_MEMBERS];
        row[..values.len()].copy_from_slice(values);
        let mut offset = DVec3::ZERO;
        if self.targets[i].len() >= 2 {
            for _ in 0..rounds {
                row = self.solve_vertex(i, self.rest[i] + offset, &row[..bones.len()]);
                offset = self.best_offset(i, &row[..bones.len()], stiffness);
            }
        }
        (offset.as_vec3().to_array(), row)
    }

    /// The offset for given weights: a linear least squares problem of three unknowns.
    fn best_offset(&self, i: usize, values: &[f32], stiffness: f64) -> DVec3 {
        let (mut a, mut b) = (DMat3::from_diagonal(DVec3::splat(stiffness)), DVec3::ZERO);
        for target in &self.targets[i] {
            let pose = &self.poses[target.pose];
            let transform = blended_transform(self.row(i).0, values, &pose.pose_from_rest);
            let transposed = transform.matrix3.transpose();
            a += transposed * transform.matrix3 * pose.alpha;
            b += transposed * (target.position - transform.transform_point3(self.rest[i])) * pose.alpha;
        }
        a.inverse() * b
    }
}
