//! Strokes, and the way back.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::checks::check_length;
use super::residual::{reachability, residual};
use super::{SculptSolver, Target};
use crate::error::{Error, Result};

/// What a stroke did.
#[derive(Debug, Clone)]
pub struct Stroke {
    /// 1 - |residual after| / |residual before| over the touched vertices: 1 if the sculpt was reached, 0 if weights
    /// could do nothing for it.
    pub reachability: f64,
    /// What is left from each touched vertex to its target, in pose space.
    pub residuals: Vec<[f32; 3]>,
}

/// The other side of a stroke: what to exchange with the solver's state to go back or forth over it.
#[derive(Debug, Clone)]
pub(super) struct Step {
    pose: usize,
    vertices: Vec<u32>,
    /// Rows of the touched vertices, one after the other.
    values: Vec<f32>,
    targets: Vec<Option<DVec3>>,
    reachability: f64,
}

impl SculptSolver {
    /// Takes `targets`, the sculpted positions of `vertices` in a pose, into memory and solves for these vertices.
    ///
    /// A vertex that was sculpted in this pose before gets the new target; its targets in other poses stay.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a vertex or pose that is not there, a vertex named twice or a target that is not
    /// finite, [`Error::LengthMismatch`]. Nothing has changed then.
    pub fn stroke(&mut self, pose: usize, vertices: &[u32], targets: &[[f32; 3]]) -> Result<Stroke> {
        self.pose(pose)?;
        self.check_stroke(vertices, targets)?;
        let targets: Vec<DVec3> = targets.iter().map(|&t| Vec3::from(t).as_dvec3()).collect();
        let before = self.residuals_to(pose, vertices, &targets);
        let goals = targets.iter().map(|&t| Some(t)).collect();
        let old_targets = self.exchange_targets(pose, vertices, goals);
        let solve = |&i: &u32| self.solve_vertex(i as usize, self.rest[i as usize], self.row(i as usize).1);
        let solved: Vec<_> = vertices.par_iter().with_min_len(64).map(solve).collect();
        let rows = vertices.iter().zip(&solved);
        let values = rows.flat_map(|(&i, row)| &row[..self.range(i as usize).len()]).copied().collect();
        let old_values = self.exchange_values(vertices, values);
        let after = self.residuals_to(pose, vertices, &targets);
        let reachability = reachability(&before, &after);
        let vertices = vertices.to_vec();
        self.undo.push(Step { pose, vertices, values: old_values, targets: old_targets, reachability });
        self.redo.clear();
        Ok(Stroke { reachability, residuals: after.iter().map(|r| r.as_vec3().to_array()).collect() })
    }

    /// Takes the last stroke back, weights and memory, and gives the vertices it had touched; `None` if there is none.
    pub fn undo(&mut self) -> Option<&[u32]> {
        let step = self.undo.pop()?;
        let step = self.exchange(step);
        self.redo.push(step);
        self.redo.last().map(|step| step.vertices.as_slice())
    }

    /// Does the stroke that was last taken back again; `None` if there is none.
    pub fn redo(&mut self) -> Option<&[u32]> {
        let step = self.redo.pop()?;
        let step = self.exchange(step);
        self.undo.push(step);
        self.undo.last().map(|step| step.vertices.as_slice())
    }

    /// Number of strokes that can be taken back.
    pub fn stroke_count(&self) -> usize {
        self.undo.len()
    }

    /// The reachability of the last stroke that has not been taken back, if any.
    pub fn reachability(&self) -> Option<f64> {
        self.undo.last().map(|step| step.reachability)
    }

    fn exchange(&mut self, step: Step) -> Step {
        let targets = self.exchange_targets(step.pose, &step.vertices, step.targets);
        let values = self.exchange_values(&step.vertices, step.values);
        Step { targets, values, ..step }
    }

    fn exchange_targets(&mut self, pose: usize, vertices: &[u32], targets: Vec<Option<DVec3>>) -> Vec<Option<DVec3>> {
        let exchange_one = |(&i, target): (&u32, Option<DVec3>)| {
            let memory = &mut self.targets[i as usize];
            let known = memory.iter().position(|t| t.pose == pose).map(|at| memory.remove(at).position);
            if let Some(position) = target {
                let at = memory.partition_point(|t| t.pose < pose);
                memory.insert(at, Target { pose, position });
            }
            known
        };
        vertices.iter().zip(targets).map(exchange_one).collect()
    }

    fn exchange_values(&mut self, vertices: &[u32], mut values: Vec<f32>) -> Vec<f32> {
        let mut rest = values.as_mut_slice();
        for &i in vertices {
            let range = self.range(i as usize);
            let (row, after) = rest.split_at_mut(range.len());
            self.values[range].swap_with_slice(row);
            rest = after;
        }
        values
    }

    fn residuals_to(&self, pose: usize, vertices: &[u32], targets: &[DVec3]) -> Vec<DVec3> {
        let pose = &self.poses[pose];
        let one = |(&i, &target): (&u32, &DVec3)| residual(self, pose, i as usize, target);
        vertices.par_iter().zip(targets).with_min_len(256).map(one).collect()
    }

    fn check_stroke(&self, vertices: &[u32], targets: &[[f32; 3]]) -> Result<()> {
        check_length("targets", targets.len(), vertices.len())?;
        self.check_vertices(vertices)?;
        let invalid = |name, value, must| Err(Error::InvalidParameter { name, value, must });
        if let Some(&x) = targets.as_flattened().iter().find(|x| !x.is_finite()) {
            return invalid("targets", x.into(), "every sculpted position must be finite");
        }
        let mut sorted = vertices.to_vec();
        sorted.sort_unstable();
        match sorted.windows(2).find(|w| w[0] == w[1]) {
            Some(twice) => invalid("vertex", twice[0].into(), "a stroke may name it only once"),
            None => Ok(()),
        }
    }
}
