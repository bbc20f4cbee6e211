//! `Refiner`: a character prepared for refinement by position-based dynamics.

use std::sync::{Mutex, PoisonError};

use glam::DAffine3;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::{ThreadPool, ThreadPoolBuilder};
use skinwright_core::refine as core;
use skinwright_core::{Progress, TriMesh};

use crate::arrays::{self, Matrix, Vector, entries, triples};
use crate::error::{InvalidParameter, SkinwrightError, enter, enter_stoppable, is_forked, to_python};
use crate::memory;
use crate::ranges;
use crate::skinning::{Stack, pose, vectors};
use crate::weights::Weights;

/// A character prepared once (lattice, embedding, joints) for any number of poses.
#[pyclass(frozen, module = "skinwright_native")]
pub struct Refiner {
    core: core::Refiner,
    pool: Option<ThreadPool>,
    last: Mutex<Option<(Vec<DAffine3>, core::Quality)>>,
}

impl Refiner {
    /// Runs `work` with the GIL freed, on the kept pool: starting threads takes longer than a stage of a frame.
    fn enter<T: Send>(&self, py: Python<'_>, work: impl FnOnce() -> skinwright_core::Result<T> + Send) -> PyResult<T> {
        match &self.pool {
            Some(pool) if !is_forked() => enter(py, 0, || pool.install(work)),
            _ => enter(py, 0, work),
        }
    }
}

#[pymethods]
impl Refiner {
    #[new]
    #[pyo3(signature = (rest_positions, triangles, weights, bone_parents, bone_segments, *, cell=None, stretch=1.0,
                        volume=1.0, bind=1.08, energy=0.1, self_collision=true, threads=0))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        rest_positions: Matrix<'_, f32>,
        triangles: Matrix<'_, u32>,
        weights: &Weights,
        bone_parents: Vector<'_, i32>,
        bone_segments: Stack<'_, f64>,
        cell: Option<f64>,
        stretch: f64,
        volume: f64,
        bind: f64,
        energy: f64,
        self_collision: bool,
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
    ) -> PyResult<Self> {
        let (positions, triangles) =
            (arrays::positions(&rest_positions, "rest_positions")?, triples(&triangles, "triangles")?);
        let (weights, parents) = (weights.to_core(py)?, entries(&bone_parents));
        let segments = segments(&bone_segments)?;
        let settings = core::Settings { cell, stretch, volume, bind, energy, self_collision };
        settings.check().map_err(to_python)?;
        memory::expect("Preparing the refinement", memory::of_refiner(&positions, &triangles, cell))?;
        let build = |progress: &Progress| {
            let mesh = TriMesh::new(&positions, &triangles, "character")?;
            core::Refiner::new(&mesh, &weights, &parents, &segments, settings, progress)
        };
        let core = enter_stoppable(py, threads, build)?;
        let pool = (threads > 0).then(|| ThreadPoolBuilder::new().num_threads(threads).build()).transpose();
        let pool = pool.map_err(|error| SkinwrightError::new_err(format!("no threads can be started: {error}")))?;
        Ok(Self { core, pool, last: Mutex::new(None) })
    }

    /// Refined positions (V, 3) of a pose (B, 4, 4); `quality` "live" takes few steps, "bake" more.
    #[pyo3(signature = (pose_from_rest, *, quality="live"))]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        pose_from_rest: Stack<'py, f64>,
        quality: &str,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let pose = pose(&pose_from_rest)?;
        let Some(quality) = core::Quality::ALL.into_iter().find(|q| q.name() == quality) else {
            return Err(InvalidParameter::new_err(format!("quality is {quality:?}, but must be \"live\" or \"bake\"")));
        };
        let refined = self.enter(py, || self.core.solve(&pose, quality))?;
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some((pose, quality));
        vectors(py, refined)
    }

    /// Figures of positions (V, 3) that anybody made in a pose (B, 4, 4): "pairs" that intersect, and for each joint that
    /// turns its "bone", "volume" against rest and "bulge".
    fn measure(
        &self,
        py: Python<'_>,
        pose_from_rest: Stack<'_, f64>,
        positions: Matrix<'_, f32>,
    ) -> PyResult<Py<PyDict>> {
        let (pose, positions) = (pose(&pose_from_rest)?, triples(&positions, "positions")?);
        let (pairs, joints) = self.enter(py, || self.core.measure(&pose, &positions))?;
        let figures = PyDict::new(py);
        figures.set_item("pairs", pairs)?;
        let joint = |joint: &core::JointMeasure| {
            let figures = PyDict::new(py);
            figures.set_item("bone", joint.bone)?;
            figures.set_item("volume", joint.volume)?;
            figures.set_item("bulge", joint.bulge)?;
            Ok(figures)
        };
        figures.set_item("joints", joints.iter().map(joint).collect::<PyResult<Vec<_>>>()?)?;
        Ok(figures.unbind())
    }

    /// Figures of the pose solved last, which is solved once more for them. None before the first.
    fn report(&self, py: Python<'_>) -> PyResult<Option<Py<PyDict>>> {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let Some((pose, quality)) = last else { return Ok(None) };
        let solve = || self.core.solve_with_report(&pose, quality, core::Kernel::Lanes);
        let (_, report) = self.enter(py, solve)?;
        Ok(Some(figures(py, &report)?.unbind()))
    }
}

fn segments(array: &Stack<'_, f64>) -> PyResult<Vec<[[f64; 3]; 2]>> {
    let &[_, 2, 3] = array.shape() else {
        let shape = array.shape();
        return Err(InvalidParameter::new_err(format!("bone_segments must have shape (B, 2, 3), not {shape:?}")));
    };
    let end = |m: &numpy::ndarray::ArrayView2<'_, f64>, r: usize| std::array::from_fn(|c| m[[r, c]]);
    Ok(array.as_array().outer_iter().map(|m| [end(&m, 0), end(&m, 1)]).collect())
}

fn figures<'py>(py: Python<'py>, report: &core::Report) -> PyResult<Bound<'py, PyDict>> {
    let figures = PyDict::new(py);
    let joint = |joint: &core::JointReport| {
        let figures = PyDict::new(py);
        figures.set_item("bone", joint.bone)?;
        figures.set_item("angle", joint.angle)?;
        figures.set_item("volume_before", joint.volume_before)?;
        figures.set_item("volume_after", joint.volume_after)?;
        figures.set_item("bulge_before", joint.bulge_before)?;
        figures.set_item("bulge_after", joint.bulge_after)?;
        figures.set_item("is_limb", joint.is_limb)?;
        Ok(figures)
    };
    figures.set_item("joints", report.joints.iter().map(joint).collect::<PyResult<Vec<_>>>()?)?;
    figures.set_item("pairs_at_rest", report.pairs_at_rest)?;
    figures.set_item("pairs_before", report.pairs_before)?;
    figures.set_item("pairs_after", report.pairs_after)?;
    figures.set_item("active_tetrahedra", report.active_tetrahedra)?;
    figures.set_item("inverted_tetrahedra", report.inverted_tetrahedra)?;
    figures.set_item("tetrahedra", report.tetrahedra)?;
    figures.set_item("cloned_tetrahedra", report.cloned_tetrahedra)?;
    figures.set_item("nodes", report.nodes)?;
    figures.set_item("constraints", report.constraints)?;
    figures.set_item("iterations", report.iterations)?;
    let stages = PyDict::new(py);
    report.stages.iter().try_for_each(|(name, ms)| stages.set_item(name, ms))?;
    figures.set_item("milliseconds", stages)?;
    Ok(figures)
}

/// Pairs (P, 2) of triangles that pass through each other and share no vertex, ascending.
#[pyfunction]
#[pyo3(signature = (positions, triangles, *, threads=0))]
pub fn intersecting_pairs<'py>(
    py: Python<'py>,
    positions: Matrix<'py, f32>,
    triangles: Matrix<'py, u32>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<u32>>> {
    let (positions, triangles) = (triples(&positions, "positions")?, triples(&triangles, "triangles")?);
    memory::expect("Looking for intersections", memory::of_pairs(triangles.len()))?;
    let find = || {
        TriMesh::new(&positions, &triangles, "character")?;
        Ok(core::intersecting_pairs(&positions, &triangles))
    };
    let pairs = enter(py, threads, find)?;
    let shape = [pairs.len(), 2];
    PyArray1::from_vec(py, pairs.into_flattened()).reshape(shape)
}
