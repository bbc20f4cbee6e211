//! Transfer in steps: `Inpainting`, whose parts are kept while settings and masks change.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use skinwright_core::Progress;
use skinwright_core::transfer::{self as core, TargetMesh};

use crate::arrays::{Matrix, pairs, read_only, triples};
use crate::error::{enter, enter_stoppable};
use crate::job::Job;
use crate::memory;
use crate::ranges;
use crate::settings::keywords;
use crate::source::Source;
use crate::transfer::Transfer;
use crate::weights::Weights;

/// Unknowns (U,) and their solution (U, n_bones).
type RawWeights<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f64>>);

/// A body and a garment prepared for solving again and again, for the settings given: what these do not change is done
/// once. A block of the system is factored again only when its own unknowns or the smoothness length change.
#[pyclass(frozen, module = "skinwright_native")]
pub struct Inpainting {
    core: Arc<Mutex<core::Inpainting>>,
    distance: Py<PyArray1<f32>>,
    angle: Py<PyArray1<f32>>,
    islands: Py<PyArray1<u32>>,
    n_bones: u32,
    threads: usize,
}

impl Inpainting {
    /// Runs `work` on the prepared target with the GIL freed; waits for a job that holds it.
    fn enter<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut core::Inpainting) -> skinwright_core::Result<T> + Send,
    ) -> PyResult<T> {
        enter(py, self.threads, || work(&mut lock(&self.core)))
    }
}

/// The target's arrays, if there is memory to prepare them.
pub(crate) fn target_mesh(
    positions: &Matrix<'_, f32>,
    triangles: &Matrix<'_, u32>,
    edges: Option<&Matrix<'_, u32>>,
) -> PyResult<TargetMesh> {
    let target = TargetMesh {
        positions: triples(positions, "target_positions")?,
        triangles: triples(triangles, "target_triangles")?,
        edges: edges.map(|edges| pairs(edges, "target_edges")).transpose()?.unwrap_or_default(),
    };
    let faces = target.triangles.len() + target.edges.len();
    memory::expect("Preparing the target", memory::of_target(target.positions.len(), faces))?;
    Ok(target)
}

/// A panic while solving leaves only kept blocks behind, and those are whole: a poisoned lock may be used on.
fn lock(inpainting: &Mutex<core::Inpainting>) -> MutexGuard<'_, core::Inpainting> {
    inpainting.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Raises MemoryError where solving for the vertices that do not match would take too much.
pub(crate) fn expect_solve(matched: &[bool]) -> PyResult<()> {
    let unknowns = matched.iter().filter(|&&matched| !matched).count();
    memory::expect("The transfer", memory::of_solve(matched.len(), unknowns))
}

#[pymethods]
impl Inpainting {
    #[new]
    #[pyo3(signature = (source, target_positions, target_triangles, *, target_edges=None, threads=0, **settings))]
    fn new(
        py: Python<'_>,
        source: &Source,
        target_positions: Matrix<'_, f32>,
        target_triangles: Matrix<'_, u32>,
        target_edges: Option<Matrix<'_, u32>>,
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let (settings, _) = keywords(settings)?;
        let target = target_mesh(&target_positions, &target_triangles, target_edges.as_ref())?;
        let (source, n_bones) = (source.core.clone(), source.core.n_bones());
        let prepare = |progress: &Progress| core::Inpainting::new(source, target, &settings, progress);
        let core = enter_stoppable(py, threads, prepare)?;
        let (distance, angle) = (read_only(py, core.distances())?, read_only(py, core.angles())?);
        let islands = read_only(py, core.island_of_vertex())?;
        Ok(Self { core: Arc::new(Mutex::new(core)), distance, angle, islands, n_bones, threads })
    }

    /// Distance of each vertex to its closest source point (V,), world units.
    #[getter]
    fn distance(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.distance.clone_ref(py)
    }

    /// Angle between the normals there (V,), radians, NaN where a normal is missing.
    #[getter]
    fn angle(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.angle.clone_ref(py)
    }

    /// Island of each vertex (V,), 4294967295 for a vertex that no triangle uses.
    #[getter]
    fn islands(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.islands.clone_ref(py)
    }

    /// Gives the source other weights; nothing geometric is computed again.
    fn set_source_weights(&self, py: Python<'_>, weights: &Weights) -> PyResult<()> {
        let weights = weights.to_core(py)?;
        self.enter(py, |inpainting| inpainting.set_source_weights(weights))
    }

    /// Which vertices match (V,) under these settings; nothing is solved.
    #[pyo3(signature = (**settings))]
    fn matched<'py>(
        &self,
        py: Python<'py>,
        settings: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let (settings, mask) = keywords(settings)?;
        let matched = self.enter(py, |inpainting| inpainting.matched(mask.as_deref(), &settings))?;
        Ok(PyArray1::from_vec(py, matched))
    }

    /// How far the row that each vertex takes from the source is trusted (V,), 0 to 1; nothing is solved.
    #[pyo3(signature = (**settings))]
    fn confidence<'py>(
        &self,
        py: Python<'py>,
        settings: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (settings, mask) = keywords(settings)?;
        let confidence = self.enter(py, |inpainting| inpainting.confidence(mask.as_deref(), &settings))?;
        Ok(PyArray1::from_vec(py, confidence))
    }

    /// Solves under these settings, factoring only the blocks that changed.
    #[pyo3(signature = (**settings))]
    fn solve(&self, py: Python<'_>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Transfer> {
        let (settings, mask) = keywords(settings)?;
        expect_solve(&self.enter(py, |inpainting| inpainting.matched(mask.as_deref(), &settings))?)?;
        let solve = |progress: &Progress| lock(&self.core).solve(mask.as_deref(), &settings, progress);
        Transfer::of(py, enter_stoppable(py, self.threads, solve)?)
    }

    /// Starts `solve` on threads of its own. With `near` only the neighbourhood of what the mask has changed since the last
    /// solve is solved again, where that is possible: `report["solved_near"]` is its number of vertices, or None.
    #[pyo3(signature = (*, near=false, **settings))]
    fn start(&self, py: Python<'_>, near: bool, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Job> {
        let (settings, mask) = keywords(settings)?;
        // While another job holds the target there is nobody to ask; that one was looked at.
        if let Ok(mut held) = self.core.try_lock() {
            let inpainting: &mut core::Inpainting = &mut held;
            if !(near && inpainting.has_base()) {
                expect_solve(&enter(py, self.threads, || inpainting.matched(mask.as_deref(), &settings))?)?;
            }
        }
        let core = Arc::clone(&self.core);
        let work = move |progress: &Progress| {
            let (mut core, mask) = (lock(&core), mask.as_deref());
            if near { core.solve_near(mask, &settings, progress) } else { core.solve(mask, &settings, progress) }
        };
        Job::start(self.threads, work, |py, transfer| Ok(Py::new(py, Transfer::of(py, transfer)?)?.into_any()))
    }

    /// The unknowns (U,) and their solution (U, n_bones) before clamping and normalising, for checks against other
    /// solvers.
    #[pyo3(signature = (**settings))]
    fn raw_weights<'py>(&self, py: Python<'py>, settings: Option<&Bound<'py, PyDict>>) -> PyResult<RawWeights<'py>> {
        let (settings, mask) = keywords(settings)?;
        let matched = self.enter(py, |inpainting| inpainting.matched(mask.as_deref(), &settings))?;
        expect_solve(&matched)?;
        let unknowns = matched.iter().filter(|&&matched| !matched).count() as u64;
        memory::expect("An array of all bones", 16 * unknowns * u64::from(self.n_bones))?;
        let raw = self.enter(py, |inpainting| inpainting.raw_weights(mask.as_deref(), &settings))?;
        let n_bones = raw.values.len().checked_div(raw.vertices.len()).unwrap_or(0);
        let shape = [raw.vertices.len(), n_bones];
        let values = PyArray1::from_vec(py, raw.values).reshape(shape)?;
        Ok((PyArray1::from_vec(py, raw.vertices), values))
    }
}
