//! Transfer by weight inpainting: `Source`, `Inpainting`, `Transfer` and the one-off `transfer_weights`.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;
use skinwright_core::Progress;
use skinwright_core::transfer::{self as core, IslandPolicy, Length, MaskValue, Settings};

use crate::arrays::{Matrix, Vector, entries, read_only, triples};
use crate::error::{InvalidParameter, enter, to_python};
use crate::job::Job;
use crate::weights::Weights;

/// Triangles (Q,), barycentric coordinates (Q, 3) and distances (Q,).
type ClosestPoints<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);
/// Unknowns (U,) and their solution (U, n_bones).
type RawWeights<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f64>>);

/// What a transfer gives back; every array has one entry a target vertex.
#[pyclass(frozen, get_all, module = "skinwright_native")]
pub struct Transfer {
    weights: Py<Weights>,
    matched: Py<PyArray1<bool>>,
    distance: Py<PyArray1<f32>>,
    angle: Py<PyArray1<f32>>,
    raw_minimum: f64,
    report: Py<PyDict>,
}

/// Distance and angle of every vertex, shared by all results of one target.
struct Closest {
    distance: Py<PyArray1<f32>>,
    angle: Py<PyArray1<f32>>,
}

impl Closest {
    fn of(py: Python<'_>, inpainting: &core::Inpainting) -> PyResult<Self> {
        let distance = inpainting.points().iter().map(|point| point.distance as f32).collect();
        Ok(Self { distance: read_only(py, distance)?, angle: read_only(py, inpainting.angles().to_vec())? })
    }

    fn present(&self, py: Python<'_>, transfer: core::Transfer) -> PyResult<Transfer> {
        Ok(Transfer {
            weights: Py::new(py, Weights::from_core(py, transfer.weights)?)?,
            matched: read_only(py, transfer.matched)?,
            distance: self.distance.clone_ref(py),
            angle: self.angle.clone_ref(py),
            raw_minimum: transfer.report.raw_minimum,
            report: report_dict(py, &transfer.report)?.unbind(),
        })
    }
}

fn report_dict<'py>(py: Python<'py>, report: &core::Report) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("vertices", report.vertices)?;
    dict.set_item("matched", report.matched)?;
    dict.set_item("inpainted", report.inpainted)?;
    dict.set_item("loose", report.loose)?;
    dict.set_item("unweighted", report.unweighted)?;
    dict.set_item("islands", report.islands)?;
    let unmatched = PyList::empty(py);
    for island in &report.unmatched_islands {
        let entry = PyDict::new(py);
        entry.set_item("first_vertex", island.first_vertex)?;
        entry.set_item("vertices", island.vertices)?;
        entry.set_item("policy", policy_name(island.policy))?;
        unmatched.append(entry)?;
    }
    dict.set_item("unmatched_islands", unmatched)?;
    dict.set_item("blocks", report.blocks)?;
    dict.set_item("factored_blocks", report.factored_blocks)?;
    dict.set_item("bones_used", report.bones_used)?;
    dict.set_item("most_influences", report.most_influences)?;
    dict.set_item("source_unweighted", report.source_unweighted)?;
    dict.set_item("source_unnormalised", report.source_unnormalised)?;
    dict.set_item("raw_minimum", report.raw_minimum)?;
    dict.set_item("largest_residual", report.largest_residual)?;
    dict.set_item("max_distance", report.max_distance)?;
    dict.set_item("smoothness_length", report.smoothness_length)?;
    let seconds = PyDict::new(py);
    for (stage, spent) in &report.seconds {
        seconds.set_item(stage, spent)?;
    }
    dict.set_item("seconds", seconds)?;
    Ok(dict)
}

/// The names Python uses for the policies.
fn policy_name(policy: IslandPolicy) -> &'static str {
    match policy {
        IslandPolicy::Bridge => "bridge",
        IslandPolicy::Nearest => "nearest",
        IslandPolicy::Rigid => "rigid",
        IslandPolicy::Skip => "skip",
    }
}

fn policy(name: &str) -> PyResult<IslandPolicy> {
    IslandPolicy::ALL.into_iter().find(|&policy| policy_name(policy) == name).ok_or_else(|| {
        let names = IslandPolicy::ALL.map(policy_name).join(", ");
        InvalidParameter::new_err(format!("island_policy is {name:?}, but must be one of {names}"))
    })
}

/// Settings and mask from keyword arguments; what is absent keeps the core's default.
fn keywords(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<(Settings, Option<Vec<MaskValue>>)> {
    let (mut settings, mut mask) = (Settings::default(), None);
    let (mut max_distance, mut smoothness_length) = (None, None);
    for (name, value) in keywords.into_iter().flatten() {
        match name.extract::<&str>()? {
            "max_distance" => max_distance = value.extract()?,
            "relative_max_distance" => settings.max_distance = Length::Relative(value.extract()?),
            "max_normal_angle" => settings.max_normal_angle = value.extract()?,
            "match_flipped_normals" => settings.match_flipped_normals = value.extract()?,
            "mask" => mask = mask_values(value.extract()?)?,
            "smoothness_length" => smoothness_length = value.extract()?,
            "relative_smoothness_length" => settings.smoothness_length = Length::Relative(value.extract()?),
            "smoothing_iterations" => settings.smoothing_iterations = value.extract()?,
            "smoothing_factor" => settings.smoothing_factor = value.extract()?,
            "max_influences" => settings.max_influences = value.extract()?,
            "island_policy" => settings.island_policy = policy(value.extract()?)?,
            unknown => return Err(PyTypeError::new_err(format!("there is no setting named {unknown:?}"))),
        }
    }
    // An absolute length wins over the relative one.
    settings.max_distance = max_distance.map_or(settings.max_distance, Length::Absolute);
    settings.smoothness_length = smoothness_length.map_or(settings.smoothness_length, Length::Absolute);
    settings.check().map_err(to_python)?;
    Ok((settings, mask))
}

fn mask_values(mask: Option<Vector<'_, u8>>) -> PyResult<Option<Vec<MaskValue>>> {
    let value = |(i, x)| match x {
        0 => Ok(MaskValue::Inpaint),
        1 => Ok(MaskValue::Automatic),
        2 => Ok(MaskValue::ForceMatch),
        _ => Err(InvalidParameter::new_err(format!("mask is {x} at vertex {i}, but must be 0, 1 or 2"))),
    };
    mask.map(|mask| entries(&mask).into_iter().enumerate().map(value).collect()).transpose()
}

/// A body prepared once (checks, BVH, normals) for any number of garments.
#[pyclass(frozen, module = "skinwright_native")]
pub struct Source {
    core: core::Source,
}

#[pymethods]
impl Source {
    #[new]
    #[pyo3(signature = (positions, triangles, weights, *, threads=0))]
    fn new(
        py: Python<'_>,
        positions: Matrix<'_, f32>,
        triangles: Matrix<'_, u32>,
        weights: &Weights,
        threads: usize,
    ) -> PyResult<Self> {
        let (positions, triangles) = (triples(&positions, "positions")?, triples(&triangles, "triangles")?);
        let weights = weights.to_core(py)?;
        let core = enter(py, threads, || core::Source::new(&positions, triangles, weights))?;
        Ok(Self { core })
    }

    /// The closest point of this body to each of (Q, 3) positions: its triangle (Q,), barycentric coordinates (Q, 3) and
    /// distance (Q,).
    #[pyo3(signature = (positions, *, threads=0))]
    fn closest_points<'py>(
        &self,
        py: Python<'py>,
        positions: Matrix<'_, f32>,
        threads: usize,
    ) -> PyResult<ClosestPoints<'py>> {
        let positions = triples(&positions, "positions")?;
        let (triangles, barycentric, distances) = enter(py, threads, || {
            let points = self.core.index().closest_points(&positions);
            let columns = points.into_par_iter().map(|p| (p.triangle, (p.barycentric, p.distance)));
            let (triangles, (barycentric, distances)): (Vec<_>, (Vec<_>, Vec<_>)) = columns.unzip();
            Ok((triangles, barycentric, distances))
        })?;
        let barycentric = PyArray1::from_vec(py, barycentric.into_flattened()).reshape([triangles.len(), 3])?;
        Ok((PyArray1::from_vec(py, triangles), barycentric, PyArray1::from_vec(py, distances)))
    }

    /// Transfers this body's weights to one garment. The settings are those of `transfer_weights`.
    #[pyo3(signature = (target_positions, target_triangles, *, threads=0, **settings))]
    fn transfer(
        &self,
        py: Python<'_>,
        target_positions: Matrix<'_, f32>,
        target_triangles: Matrix<'_, u32>,
        threads: usize,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Transfer> {
        let (settings, mask) = keywords(settings)?;
        let positions = triples(&target_positions, "target_positions")?;
        let triangles = triples(&target_triangles, "target_triangles")?;
        let (inpainting, transfer) = enter(py, threads, || {
            core::transfer_weights(&self.core, positions, triangles, mask.as_deref(), &settings)
        })?;
        Closest::of(py, &inpainting)?.present(py, transfer)
    }
}

/// Transfers skin weights from a source mesh to a target mesh by weight inpainting, once.
#[pyfunction]
#[pyo3(signature = (source_positions, source_triangles, source_weights, target_positions, target_triangles, *,
    threads=0, **settings),
    text_signature = "(source_positions, source_triangles, source_weights, target_positions, target_triangles, *, \
    max_distance=None, relative_max_distance=0.05, max_normal_angle=0.6108652381980153, match_flipped_normals=True, \
    mask=None, smoothness_length=None, relative_smoothness_length=0.05, smoothing_iterations=0, \
    smoothing_factor=0.2, max_influences=0, island_policy='bridge', threads=0)")]
#[expect(clippy::too_many_arguments, reason = "the arguments of the Python function")]
pub fn transfer_weights(
    py: Python<'_>,
    source_positions: Matrix<'_, f32>,
    source_triangles: Matrix<'_, u32>,
    source_weights: &Weights,
    target_positions: Matrix<'_, f32>,
    target_triangles: Matrix<'_, u32>,
    threads: usize,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Transfer> {
    let source = Source::new(py, source_positions, source_triangles, source_weights, threads)?;
    source.transfer(py, target_positions, target_triangles, threads, settings)
}

/// A body and a garment prepared for solving again and again: closest points are found once, a block of the system is
/// factored again only when its own unknowns or the smoothness length change.
#[pyclass(frozen, module = "skinwright_native")]
pub struct Inpainting {
    core: Arc<Mutex<core::Inpainting>>,
    closest: Arc<Closest>,
    islands: Py<PyArray1<u32>>,
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

/// A panic while solving leaves only kept blocks behind, and those are whole: a poisoned lock may be used on.
fn lock(inpainting: &Mutex<core::Inpainting>) -> MutexGuard<'_, core::Inpainting> {
    inpainting.lock().unwrap_or_else(PoisonError::into_inner)
}

#[pymethods]
impl Inpainting {
    #[new]
    #[pyo3(signature = (source, target_positions, target_triangles, *, threads=0))]
    fn new(
        py: Python<'_>,
        source: &Source,
        target_positions: Matrix<'_, f32>,
        target_triangles: Matrix<'_, u32>,
        threads: usize,
    ) -> PyResult<Self> {
        let positions = triples(&target_positions, "target_positions")?;
        let triangles = triples(&target_triangles, "target_triangles")?;
        let source = source.core.clone();
        let core = enter(py, threads, || core::Inpainting::new(source, positions, triangles, &Progress::default()))?;
        let closest = Arc::new(Closest::of(py, &core)?);
        let islands = read_only(py, core.islands().of_vertex().to_vec())?;
        Ok(Self { core: Arc::new(Mutex::new(core)), closest, islands, threads })
    }

    /// Distance of each vertex to its closest source point (V,), world units.
    #[getter]
    fn distance(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.closest.distance.clone_ref(py)
    }

    /// Angle between the normals there (V,), radians, NaN where a normal is missing.
    #[getter]
    fn angle(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.closest.angle.clone_ref(py)
    }

    /// Island of each vertex (V,), 4294967295 for a vertex that no triangle uses.
    #[getter]
    fn islands(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.islands.clone_ref(py)
    }

    /// Gives the source other weights; nothing geometric is computed anew.
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

    /// Solves under these settings, factoring only the blocks that changed.
    #[pyo3(signature = (**settings))]
    fn solve(&self, py: Python<'_>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Transfer> {
        let (settings, mask) = keywords(settings)?;
        let solve =
            |inpainting: &mut core::Inpainting| inpainting.solve(mask.as_deref(), &settings, &Progress::default());
        let transfer = self.enter(py, solve)?;
        self.closest.present(py, transfer)
    }

    /// Starts `solve` on threads of its own.
    #[pyo3(signature = (**settings))]
    fn start(&self, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Job> {
        let (settings, mask) = keywords(settings)?;
        let (core, closest) = (Arc::clone(&self.core), Arc::clone(&self.closest));
        let work = move |progress: &Progress| lock(&core).solve(mask.as_deref(), &settings, progress);
        Ok(Job::start(self.threads, work, Box::new(move |py, transfer| closest.present(py, transfer))))
    }

    /// The unknowns (U,) and their solution (U, n_bones) before clamping and normalising, for checks against other
    /// solvers.
    #[pyo3(signature = (**settings))]
    fn raw_weights<'py>(&self, py: Python<'py>, settings: Option<&Bound<'py, PyDict>>) -> PyResult<RawWeights<'py>> {
        let (settings, mask) = keywords(settings)?;
        let raw = self.enter(py, |inpainting| inpainting.raw_weights(mask.as_deref(), &settings))?;
        let n_bones = raw.values.len().checked_div(raw.vertices.len()).unwrap_or(0);
        let shape = [raw.vertices.len(), n_bones];
        let values = PyArray1::from_vec(py, raw.values).reshape(shape)?;
        Ok((PyArray1::from_vec(py, raw.vertices), values))
    }
}
