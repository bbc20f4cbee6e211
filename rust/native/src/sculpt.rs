//! Sculpt to weights: `SculptSolver`, `Stroke`, and the bare `simplex_qp`.

use std::sync::{Mutex, PoisonError};

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use skinwright_core::sculpt::{self as core, MAX_MEMBERS, Options, Residuals, SimplexQp};

use crate::arrays::{Matrix, Vector, check_finite, entries, triples};
use crate::error::{InvalidParameter, SkinwrightError, enter};
use crate::memory;
use crate::ranges;
use crate::skinning::{Stack, pose, vectors};
use crate::weights::Weights;

/// What a stroke did.
#[pyclass(frozen, get_all, module = "skinwright_native")]
pub struct Stroke {
    vertices: Py<PyArray1<u32>>,
    weights: Py<Weights>,
    reachability: f64,
    residuals: Py<PyArray2<f32>>,
}

/// A character prepared for strokes: candidates, poses, and what each vertex was sculpted to in them.
#[pyclass(frozen, module = "skinwright_native")]
pub struct SculptSolver {
    core: Mutex<Session>,
    threads: usize,
}

struct Session {
    solver: core::SculptSolver,
    /// The pose added last.
    pose: Option<usize>,
}

impl SculptSolver {
    /// Runs `work` with the GIL freed.
    fn enter<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Session) -> skinwright_core::Result<T> + Send,
    ) -> PyResult<T> {
        // The core checks before it changes anything, so a poisoned lock may be used on.
        enter(py, self.threads, || work(&mut self.core.lock().unwrap_or_else(PoisonError::into_inner)))
    }

    fn pose(&self, py: Python<'_>, pose: Option<usize>) -> PyResult<usize> {
        let last = self.enter(py, |session| Ok(session.pose))?;
        pose.or(last).ok_or_else(|| SkinwrightError::new_err("there is no pose to sculpt in: call add_pose first"))
    }
}

type VerticesAndVectors<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f32>>);

fn present(py: Python<'_>, residuals: Residuals) -> PyResult<VerticesAndVectors<'_>> {
    Ok((PyArray1::from_vec(py, residuals.vertices), vectors(py, residuals.vectors)?))
}

#[pymethods]
impl SculptSolver {
    #[new]
    #[pyo3(signature = (rest_positions, weights, *, locked=None, kappa=0.01, passes=3, threads=0))]
    fn new(
        py: Python<'_>,
        rest_positions: Matrix<'_, f32>,
        weights: &Weights,
        locked: Option<Vector<'_, bool>>,
        #[pyo3(from_py_with = ranges::kappa)] kappa: f64,
        #[pyo3(from_py_with = ranges::passes)] passes: usize,
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
    ) -> PyResult<Self> {
        let (rest, weights) = (triples(&rest_positions, "rest_positions")?, weights.to_core(py)?);
        let locked = locked.map(|l| entries(&l)).unwrap_or_default();
        let options = Options { kappa, passes };
        memory::expect("Sculpting", memory::of_sculpt(rest.len()))?;
        let solver = enter(py, threads, || core::SculptSolver::new(&rest, weights, &locked, options))?;
        Ok(Self { core: Mutex::new(Session { solver, pose: None }), threads })
    }

    /// Says how the next strokes are solved.
    fn set_options(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = ranges::kappa)] kappa: f64,
        #[pyo3(from_py_with = ranges::passes)] passes: usize,
    ) -> PyResult<()> {
        self.enter(py, |session| session.solver.set_options(Options { kappa, passes }))
    }

    /// Registers a pose and makes it the one that is sculpted in; gives its number.
    #[pyo3(signature = (pose_from_rest, *, alpha=1.0))]
    fn add_pose(&self, py: Python<'_>, pose_from_rest: Stack<'_, f64>, alpha: f64) -> PyResult<usize> {
        let pose_from_rest = pose(&pose_from_rest)?;
        self.enter(py, |session| {
            let number = session.solver.add_pose(pose_from_rest, alpha)?;
            session.pose = Some(number);
            Ok(number)
        })
    }

    /// Makes every vertex hold the position it now has in a pose.
    #[pyo3(signature = (pose_from_rest, *, alpha=0.2))]
    fn guard(&self, py: Python<'_>, pose_from_rest: Stack<'_, f64>, alpha: f64) -> PyResult<()> {
        let pose_from_rest = pose(&pose_from_rest)?;
        self.enter(py, |session| session.solver.guard(&pose_from_rest, alpha))
    }

    /// Guards the turns of some joints by +-45 and +-90 degrees.
    #[pyo3(signature = (bone_parents, bone_heads, joints, *, alpha=0.2))]
    fn guard_range_of_motion(
        &self,
        py: Python<'_>,
        bone_parents: Vector<'_, i32>,
        bone_heads: Matrix<'_, f32>,
        joints: Vector<'_, u32>,
        alpha: f64,
    ) -> PyResult<()> {
        let (parents, heads) = (entries(&bone_parents), triples(&bone_heads, "bone_heads")?);
        let joints = entries(&joints);
        self.enter(py, |session| session.solver.guard_range_of_motion(&parents, &heads, &joints, alpha))
    }

    /// Forgets all guards.
    fn clear_guards(&self, py: Python<'_>) -> PyResult<()> {
        self.enter(py, |session| {
            session.solver.clear_guards();
            Ok(())
        })
    }

    /// Where `rest_positions`, one for each of `vertices`, lie in a pose under the present weights.
    #[pyo3(signature = (vertices, rest_positions, *, pose=None))]
    fn posed<'py>(
        &self,
        py: Python<'py>,
        vertices: Vector<'py, u32>,
        rest_positions: Matrix<'py, f32>,
        #[pyo3(from_py_with = ranges::pose)] pose: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let (pose, vertices) = (self.pose(py, pose)?, entries(&vertices));
        let rest = triples(&rest_positions, "rest_positions")?;
        vectors(py, self.enter(py, |session| session.solver.posed(pose, &vertices, &rest))?)
    }

    /// Takes the sculpted positions of `vertices` in a pose into memory and solves for these vertices.
    #[pyo3(signature = (vertices, targets, *, pose=None))]
    fn stroke(
        &self,
        py: Python<'_>,
        vertices: Vector<'_, u32>,
        targets: Matrix<'_, f32>,
        #[pyo3(from_py_with = ranges::pose)] pose: Option<usize>,
    ) -> PyResult<Stroke> {
        let (pose, vertices) = (self.pose(py, pose)?, entries(&vertices));
        let targets = triples(&targets, "targets")?;
        let (stroke, weights) = self.enter(py, |session| {
            let stroke = session.solver.stroke(pose, &vertices, &targets)?;
            Ok((stroke, session.solver.weights_of(&vertices)?))
        })?;
        Ok(Stroke {
            vertices: PyArray1::from_vec(py, vertices).unbind(),
            weights: Py::new(py, Weights::from_core(py, weights)?)?,
            reachability: stroke.reachability,
            residuals: vectors(py, stroke.residuals)?.unbind(),
        })
    }

    /// Takes the last stroke back, weights and memory; the vertices it had touched, or None if there is none.
    fn undo<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray1<u32>>>> {
        let touched = self.enter(py, |session| Ok(session.solver.undo().map(<[u32]>::to_vec)))?;
        Ok(touched.map(|vertices| PyArray1::from_vec(py, vertices)))
    }

    /// Does the stroke that was last taken back again; the vertices it had touched, or None if there is none.
    fn redo<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray1<u32>>>> {
        let touched = self.enter(py, |session| Ok(session.solver.redo().map(<[u32]>::to_vec)))?;
        Ok(touched.map(|vertices| PyArray1::from_vec(py, vertices)))
    }

    /// Number of strokes that can be taken back.
    #[getter]
    fn stroke_count(&self, py: Python<'_>) -> PyResult<usize> {
        self.enter(py, |session| Ok(session.solver.stroke_count()))
    }

    /// The present weights: of all vertices, or one row for each of `vertices`.
    #[pyo3(signature = (vertices=None))]
    fn weights(&self, py: Python<'_>, vertices: Option<Vector<'_, u32>>) -> PyResult<Weights> {
        let vertices = vertices.map(|v| entries(&v));
        let weights = self.enter(py, |session| match &vertices {
            Some(vertices) => session.solver.weights_of(vertices),
            None => Ok(session.solver.weights()),
        })?;
        Weights::from_core(py, weights)
    }

    /// The reachability of the last stroke that has not been taken back, or None.
    fn reachability(&self, py: Python<'_>) -> PyResult<Option<f64>> {
        self.enter(py, |session| Ok(session.solver.reachability()))
    }

    /// The vertices sculpted in a pose and what is left from each to its target, in pose space.
    #[pyo3(signature = (*, pose=None))]
    fn residuals<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = ranges::pose)] pose: Option<usize>,
    ) -> PyResult<VerticesAndVectors<'py>> {
        let pose = self.pose(py, pose)?;
        present(py, self.enter(py, |session| session.solver.residuals(pose))?)
    }

    /// The same in rest space: the offsets of a corrective shape key.
    #[pyo3(signature = (*, pose=None))]
    fn rest_residuals<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = ranges::pose)] pose: Option<usize>,
    ) -> PyResult<VerticesAndVectors<'py>> {
        let pose = self.pose(py, pose)?;
        present(py, self.enter(py, |session| session.solver.rest_residuals(pose))?)
    }

    /// Rest offsets and weights that together meet the sculpts of `vertices`; changes nothing.
    #[pyo3(signature = (vertices, *, stiffness=0.1, rounds=20))]
    fn fit_rest_shape<'py>(
        &self,
        py: Python<'py>,
        vertices: Vector<'py, u32>,
        stiffness: f64,
        #[pyo3(from_py_with = ranges::rounds)] rounds: usize,
    ) -> PyResult<(Bound<'py, PyArray2<f32>>, Weights)> {
        let vertices = entries(&vertices);
        let shape = self.enter(py, |session| session.solver.fit_rest_shape(&vertices, stiffness, rounds))?;
        Ok((vectors(py, shape.offsets)?, Weights::from_core(py, shape.weights)?))
    }
}

/// Minimises 1/2 w'Hw - g'w over w >= 0, sum w = sum of the start, for every problem of a stack.
#[pyfunction]
#[pyo3(signature = (h, g, start, *, threads=0))]
pub fn simplex_qp<'py>(
    py: Python<'py>,
    h: Stack<'py, f64>,
    g: Matrix<'py, f64>,
    start: Matrix<'py, f64>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let &[count, n] = start.shape() else { unreachable!("a 2-D array") };
    if h.shape() != [count, n, n] || g.shape() != [count, n] || !(1..=MAX_MEMBERS).contains(&n) {
        let shapes = format!("h {:?}, g {:?}, start {:?}", h.shape(), g.shape(), start.shape());
        return Err(InvalidParameter::new_err(format!(
            "shapes must be (P, N, N), (P, N), (P, N), N to 12, not {shapes}"
        )));
    }
    let (h, g) = (h.as_array(), g.as_array());
    check_finite(h.iter(), "h")?;
    check_finite(g.iter(), "g")?;
    check_finite(start.as_array().iter(), "start")?;
    let (h, g) = (h.as_standard_layout(), g.as_standard_layout());
    let (h, g) = (h.as_slice().expect("standard layout"), g.as_slice().expect("standard layout"));
    let w = start.as_array().iter().copied().collect();
    let solved = enter(py, threads, move || Ok(if n <= 4 { solve::<4>(n, h, g, w) } else { solve::<12>(n, h, g, w) }))?;
    PyArray1::from_vec(py, solved).reshape([count, n])
}

fn solve<const N: usize>(n: usize, h: &[f64], g: &[f64], mut w: Vec<f64>) -> Vec<f64> {
    use rayon::prelude::*;
    let problems = h.par_chunks(n * n).zip(g.par_chunks(n)).zip(w.par_chunks_mut(n));
    problems.with_min_len(256).for_each(|((h, g), w)| {
        let mut qp = SimplexQp { h: [[0.0; N]; N], g: [0.0; N], n, mass: w.iter().sum() };
        let mut solution = [0.0; N];
        for i in 0..n {
            qp.h[i][..n].copy_from_slice(&h[i * n..][..n]);
            qp.g[i] = g[i];
            solution[i] = w[i];
        }
        qp.minimise(&mut solution);
        w.copy_from_slice(&solution[..n]);
    });
    w
}
