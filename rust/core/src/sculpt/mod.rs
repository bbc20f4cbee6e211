//! Sculpt to weights: the displacement an artist sculpts on a posed character becomes skin weights.
//!
//! After G. Rubino, *A Blender plug-in for the interactive optimization of skinning in skeletal animation*, Universita
//! degli Studi di Milano, 2020 (supervisor M. Tarini), called the thesis here.
//!
//! Each vertex is its own convex problem (thesis 6.4 with the bounds made exact and any number of poses):
//! min over w of  sum_p alpha_p |sum_j w_j d_jp - t_p|^2 + k^2 |w - o|^2,  w >= 0, sum w = 1,
//! with d_jp the rest position moved by bone j in pose p, t_p the sculpted position and o the weights before.
//! As sum w = 1, the first term is w'Hw with H = sum_p alpha_p E_p'E_p, E_p = [d_jp - t_p]. Lengths are divided by the
//! diagonal of the rest mesh, so that k = kappa has no unit. At rest all d_j agree: the rest shape always holds.

mod checks;
mod range_of_motion;
mod residual;
mod rest_shape;
mod simplex_qp;
mod stroke;
mod vertex;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

pub use residual::Residuals;
pub use rest_shape::RestShape;
pub use simplex_qp::SimplexQp;
pub use stroke::Stroke;

use checks::{check_character, check_length, check_options};

use crate::error::{Error, Result};
use crate::skinning;
use crate::weights::Weights;

/// Largest number of members a vertex may have.
pub const MAX_MEMBERS: usize = 12;

/// How a stroke is solved.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Pull towards the weights before the stroke, relative to the rest diagonal: 0.001 (follow the sculpt) to 0.05.
    pub kappa: f64,
    /// Proximal passes, each pulling towards the answer of the one before; more follow the sculpt more closely.
    pub passes: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { kappa: 0.01, passes: 3 }
    }
}

/// A character prepared for strokes: rest positions, candidates, poses, and what each vertex was sculpted to in them.
///
/// The members of a vertex (zero weights too) are its candidates; strokes never add or drop one.
///
/// # Example
/// ```
/// use glam::{DAffine3, DVec3};
/// use skinwright_core::Weights;
/// use skinwright_core::sculpt::{Options, SculptSolver};
///
/// // One vertex, bound to a bone that stays; the other bone may take it along.
/// let weights = Weights::new(vec![0, 2], vec![0, 1], vec![1.0, 0.0], 2)?;
/// let mut solver = SculptSolver::new(&[[0.0, 0.0, 0.0]], weights, &[], Options { passes: 50, ..Options::default() })?;
/// let pose = solver.add_pose(vec![DAffine3::IDENTITY, DAffine3::from_translation(DVec3::X)], 1.0)?;
/// let stroke = solver.stroke(pose, &[0], &[[0.25, 0.0, 0.0]])?;
/// assert!(stroke.reachability > 0.99);
/// assert!((solver.weights().row(0).1[1] - 0.25).abs() < 0.01);
/// # Ok::<(), skinwright_core::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct SculptSolver {
    rest: Vec<DVec3>,
    indptr: Vec<u32>,
    bones: Vec<u32>,
    values: Vec<f32>,
    locked: Vec<bool>,
    options: Options,
    /// Diagonal of the rest positions' box, the unit of length inside.
    diagonal: f64,
    poses: Vec<Pose>,
    /// What each vertex was sculpted to, one entry a sculpted pose.
    targets: Vec<Vec<Target>>,
    guards: vertex::Guards,
    undo: Vec<stroke::Step>,
    redo: Vec<stroke::Step>,
}

#[derive(Debug, Clone)]
struct Pose {
    pose_from_rest: Vec<DAffine3>,
    alpha: f64,
}

#[derive(Debug, Clone, Copy)]
struct Target {
    pose: usize,
    position: DVec3,
}

impl SculptSolver {
    /// Prepares `rest_positions` (V, mesh space) with their `weights`; `locked` (B, or empty for none) bones keep theirs.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::PositionNotFinite`], [`Error::WeightNegative`], [`Error::InvalidWeights`] for a
    /// vertex with more members than [`MAX_MEMBERS`], [`Error::InvalidParameter`].
    pub fn new(rest_positions: &[[f32; 3]], weights: Weights, locked: &[bool], options: Options) -> Result<Self> {
        check_character(rest_positions, &weights, locked, options)?;
        let rest: Vec<DVec3> = rest_positions.iter().map(|&p| Vec3::from(p).as_dvec3()).collect();
        let low = rest.iter().fold(DVec3::INFINITY, |low, &p| low.min(p));
        let high = rest.iter().fold(DVec3::NEG_INFINITY, |high, &p| high.max(p));
        let diagonal = if low.distance(high) > 0.0 { low.distance(high) } else { 1.0 };
        let mut all_locked = locked.to_vec();
        all_locked.resize(weights.n_bones() as usize, false);
        let targets = vec![Vec::new(); rest.len()];
        let (indptr, bones, values) = weights.into_arrays();
        Ok(Self {
            rest,
            indptr,
            bones,
            values,
            locked: all_locked,
            options,
            diagonal,
            poses: Vec::new(),
            targets,
            guards: vertex::Guards::default(),
            undo: Vec::new(),
            redo: Vec::new(),
        })
    }

    /// Says how the next strokes are solved.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for kappa <= 0 or no pass.
    pub fn set_options(&mut self, options: Options) -> Result<()> {
        check_options(options)?;
        self.options = options;
        Ok(())
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.rest.len()
    }

    /// Registers a pose (B transforms in mesh space) whose sculpted positions weigh `alpha`; gives its number.
    ///
    /// A pose that is already there, up to rounding, keeps its number and takes the new `alpha`.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::InvalidParameter`] for `alpha` <= 0.
    pub fn add_pose(&mut self, pose_from_rest: Vec<DAffine3>, alpha: f64) -> Result<usize> {
        self.check_pose(&pose_from_rest, alpha)?;
        if let Some(known) = self.poses.iter().position(|p| self.is_same_pose(&p.pose_from_rest, &pose_from_rest)) {
            self.poses[known].alpha = alpha;
            return Ok(known);
        }
        self.poses.push(Pose { pose_from_rest, alpha });
        Ok(self.poses.len() - 1)
    }

    /// Makes every vertex hold the position it now has in a pose (B transforms) with weight `alpha`, 0.1 to 0.3 as a
    /// rule. Guards add up; the cost of a stroke does not grow with their number.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::InvalidParameter`] for `alpha` <= 0.
    pub fn guard(&mut self, pose_from_rest: &[DAffine3], alpha: f64) -> Result<()> {
        self.check_pose(pose_from_rest, alpha)?;
        let mut guards = std::mem::take(&mut self.guards);
        guards.hold(self, pose_from_rest, alpha);
        self.guards = guards;
        Ok(())
    }

    /// Forgets all guards.
    pub fn clear_guards(&mut self) {
        self.guards = vertex::Guards::default();
    }

    /// Where `rest_positions`, one for each of `vertices`, lie in a pose under the present weights.
    ///
    /// The target of a brush that moved rest positions is exactly this (thesis 6.4.2, t = T v').
    ///
    /// # Errors
    /// [`Error::LengthMismatch`], [`Error::InvalidParameter`] if a vertex or the pose is not there.
    pub fn posed(&self, pose: usize, vertices: &[u32], rest_positions: &[[f32; 3]]) -> Result<Vec<[f32; 3]>> {
        check_length("rest_positions", rest_positions.len(), vertices.len())?;
        self.check_vertices(vertices)?;
        let pose = self.pose(pose)?;
        let place = |(&i, &p): (&u32, &[f32; 3])| {
            self.transform(i as usize, pose).transform_point3(Vec3::from(p).as_dvec3()).as_vec3().to_array()
        };
        Ok(vertices.par_iter().zip(rest_positions).with_min_len(1024).map(place).collect())
    }

    /// The present weights of all vertices.
    pub fn weights(&self) -> Weights {
        let arrays = (self.indptr.clone(), self.bones.clone(), self.values.clone());
        Weights::new(arrays.0, arrays.1, arrays.2, self.locked.len() as u32).expect("checked when the solver was made")
    }

    /// The present weights of `vertices`, one row each in their order.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] if a vertex is not there.
    pub fn weights_of(&self, vertices: &[u32]) -> Result<Weights> {
        self.check_vertices(vertices)?;
        Ok(self.rows_of(vertices, |_, i| self.row(i).1))
    }

    /// Rows of `vertices` with the values that `values` gives for the k-th of them, vertex i.
    fn rows_of<'v>(&self, vertices: &[u32], values: impl Fn(usize, usize) -> &'v [f32] + Sync) -> Weights {
        let row = |_: &mut (), k: usize, out: &mut Vec<(u32, f32)>| {
            let i = vertices[k] as usize;
            out.extend(self.row(i).0.iter().copied().zip(values(k, i).iter().copied()));
        };
        Weights::from_rows(vertices.len(), self.locked.len() as u32, || (), row)
    }

    fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.indptr[i] as usize..self.indptr[i + 1] as usize
    }

    fn row(&self, i: usize) -> (&[u32], &[f32]) {
        (&self.bones[self.range(i)], &self.values[self.range(i)])
    }

    fn transform(&self, i: usize, pose: &Pose) -> DAffine3 {
        let (bones, values) = self.row(i);
        skinning::blended_transform(bones, values, &pose.pose_from_rest)
    }

    fn pose(&self, pose: usize) -> Result<&Pose> {
        let must = "it must be a number that add_pose gave";
        self.poses.get(pose).ok_or(Error::InvalidParameter { name: "pose", value: pose as f64, must })
    }

    fn is_same_pose(&self, a: &[DAffine3], b: &[DAffine3]) -> bool {
        const ROUNDING: f64 = 1e-6;
        a.iter().zip(b).all(|(a, b)| {
            a.matrix3.abs_diff_eq(b.matrix3, ROUNDING)
                && a.translation.abs_diff_eq(b.translation, ROUNDING * self.diagonal)
        })
    }

    fn check_pose(&self, pose_from_rest: &[DAffine3], alpha: f64) -> Result<()> {
        check_length("pose_from_rest", pose_from_rest.len(), self.locked.len())?;
        if alpha > 0.0 && alpha.is_finite() {
            return Ok(());
        }
        Err(Error::InvalidParameter { name: "alpha", value: alpha, must: "a pose must weigh more than 0" })
    }

    fn check_vertices(&self, vertices: &[u32]) -> Result<()> {
        let must = "the mesh has no such vertex";
        match vertices.iter().find(|&&i| i as usize >= self.rest.len()) {
            Some(&i) => Err(Error::InvalidParameter { name: "vertex", value: i.into(), must }),
            None => Ok(()),
        }
    }
}
