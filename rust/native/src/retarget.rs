//! `retarget_weights`, and the same as a job.

use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use skinwright_core::retarget::{self as core, Character, Correspondence, Landmark, MatchPoints, Method, Settings};
use skinwright_core::{Progress, TriMesh};

use crate::arrays::{Matrix, Vector, entries, read_only, triples};
use crate::error::InvalidParameter;
use crate::job::call_and_job;
use crate::memory;
use crate::ranges;
use crate::skinning::{Stack, vectors};
use crate::weights::Weights;

/// Retargeted weights; every array has one entry per target vertex.
#[pyclass(frozen, get_all, module = "skinwright_native")]
pub struct Retarget {
    weights: Py<Weights>,
    confidence: Py<PyArray1<f32>>,
    matched: Py<PyArray1<bool>>,
    points: Py<PyArray2<f32>>,
    report: Py<PyDict>,
}

/// Everything a retargeting reads, owned.
struct Inputs {
    source: Owned,
    target: Owned,
    weights: skinwright_core::Weights,
    bone_map: Vec<i32>,
    source_parents: Option<Vec<i32>>,
    landmarks: Vec<Landmark>,
    settings: Settings,
}

/// Mesh and rest bones of one character.
struct Owned {
    what: &'static str,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    frames: Vec<[[f64; 4]; 4]>,
    lengths: Vec<f64>,
}

impl Inputs {
    fn expect_memory(&self) -> PyResult<()> {
        let pairs = if self.settings.method == Method::Biharmonic { self.settings.n_pairs } else { 0 };
        let bytes = memory::of_retarget(self.source.positions.len(), self.target.positions.len(), pairs);
        memory::expect("Retargeting", bytes)
    }

    fn run(&self, progress: &Progress) -> skinwright_core::Result<core::Retarget> {
        let source = TriMesh::new(&self.source.positions, &self.source.triangles, self.source.what)?;
        let target = TriMesh::new(&self.target.positions, &self.target.triangles, self.target.what)?;
        let skeleton = |of: &Owned| core::Skeleton::new(&of.frames, &of.lengths, of.what);
        let (source_skeleton, target_skeleton) = (skeleton(&self.source)?, skeleton(&self.target)?);
        core::retarget(
            Character { mesh: source, skeleton: &source_skeleton },
            &self.weights,
            Character { mesh: target, skeleton: &target_skeleton },
            Correspondence {
                bone_map: &self.bone_map,
                source_parents: self.source_parents.as_deref(),
                landmarks: &self.landmarks,
            },
            &self.settings,
            progress,
        )
    }
}

call_and_job! {
    /// Weights of one character for another with a matching skeleton.
    retarget_weights -> Retarget,
    /// Starts `retarget_weights` on threads of its own.
    start_retarget_weights,
    signature = (source_positions, source_triangles, source_weights, source_frames, source_lengths,
        target_positions, target_triangles, target_frames, target_lengths, *, bone_map, method="skeleton",
        landmarks=None, max_influences=0, threads=0, source_parents=None, match_points="surface", vertex_order=true,
        registration=true, normal_length=0.02, max_distance=0.08, max_normal_angle=1.3962634015954636, max_stretch=6.0,
        n_pairs=100, smoothing_iterations=0, smoothing_factor=0.2),
    |py, threads,
        source_positions: Matrix<'_, f32>,
        source_triangles: Matrix<'_, u32>,
        source_weights: &Weights,
        source_frames: Stack<'_, f64>,
        source_lengths: Vector<'_, f64>,
        target_positions: Matrix<'_, f32>,
        target_triangles: Matrix<'_, u32>,
        target_frames: Stack<'_, f64>,
        target_lengths: Vector<'_, f64>,
        bone_map: Vector<'_, i32>,
        method: &str,
        landmarks: Option<Matrix<'_, u32>>,
        #[pyo3(from_py_with = ranges::influences)] max_influences: usize,
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
        source_parents: Option<Vector<'_, i32>>,
        match_points: &str,
        vertex_order: bool,
        registration: bool,
        normal_length: f64,
        max_distance: f64,
        max_normal_angle: f64,
        max_stretch: f64,
        #[pyo3(from_py_with = ranges::pairs)] n_pairs: usize,
        #[pyo3(from_py_with = ranges::smoothing)] smoothing_iterations: u32,
        smoothing_factor: f64,
    | {
        let settings = Settings {
            method: method_of(method)?,
            match_points: match_points_of(match_points)?,
            vertex_order,
            registration,
            normal_length,
            max_distance,
            max_normal_angle,
            max_stretch,
            n_pairs,
            smoothing_iterations,
            smoothing_factor,
            max_influences,
        };
        let inputs = Inputs {
            source: Owned {
                what: "source",
                positions: triples(&source_positions, "source_positions")?,
                triangles: triples(&source_triangles, "source_triangles")?,
                frames: frames(&source_frames, "source_frames")?,
                lengths: entries(&source_lengths),
            },
            target: Owned {
                what: "target",
                positions: triples(&target_positions, "target_positions")?,
                triangles: triples(&target_triangles, "target_triangles")?,
                frames: frames(&target_frames, "target_frames")?,
                lengths: entries(&target_lengths),
            },
            weights: source_weights.to_core(py)?,
            bone_map: entries(&bone_map),
            source_parents: source_parents.map(|parents| entries(&parents)),
            landmarks: landmarks.map(|pairs| landmarks_of(&pairs)).transpose()?.unwrap_or_default(),
            settings,
        };
        inputs.expect_memory()?;
        inputs
    }
}

fn present(py: Python<'_>, result: core::Retarget) -> PyResult<Retarget> {
    let points = vectors(py, result.points)?;
    points.call_method1("setflags", (false,))?;
    Ok(Retarget {
        weights: Py::new(py, Weights::from_core(py, result.weights)?)?,
        confidence: read_only(py, result.confidence)?,
        matched: read_only(py, result.matched)?,
        points: points.unbind(),
        report: report_dict(py, &result.report)?.unbind(),
    })
}

fn report_dict<'py>(py: Python<'py>, report: &core::Report) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("vertices", report.vertices)?;
    dict.set_item("matched", report.matched)?;
    dict.set_item("filled", report.filled)?;
    dict.set_item("unweighted", report.unweighted)?;
    dict.set_item("bones", report.bones)?;
    dict.set_item("inherited", PyList::new(py, &report.inherited)?)?;
    dict.set_item("without_partner", PyList::new(py, &report.without_partner)?)?;
    dict.set_item("by_number", report.by_number)?;
    dict.set_item("landmarks", report.landmarks)?;
    dict.set_item("by_landmarks", report.by_landmarks)?;
    dict.set_item("size_ratio", report.size_ratio)?;
    let seconds = PyDict::new(py);
    report.seconds.iter().try_for_each(|(stage, time)| seconds.set_item(stage, time))?;
    dict.set_item("seconds", seconds)?;
    Ok(dict)
}

/// (B, 4, 4) row-major.
fn frames(array: &Stack<'_, f64>, name: &str) -> PyResult<Vec<[[f64; 4]; 4]>> {
    let &[_, 4, 4] = array.shape() else {
        let shape = array.shape();
        return Err(InvalidParameter::new_err(format!("{name} must have shape (B, 4, 4), not {shape:?}")));
    };
    let frame = |m: numpy::ndarray::ArrayView2<'_, f64>| std::array::from_fn(|r| std::array::from_fn(|c| m[[r, c]]));
    Ok(array.as_array().outer_iter().map(frame).collect())
}

/// (L, 2): a source vertex and a target vertex each.
fn landmarks_of(pairs: &Matrix<'_, u32>) -> PyResult<Vec<Landmark>> {
    let &[_, 2] = pairs.shape() else {
        let shape = pairs.shape();
        return Err(InvalidParameter::new_err(format!("landmarks must have shape (L, 2), not {shape:?}")));
    };
    Ok(pairs.as_array().rows().into_iter().map(|row| Landmark { source: row[0], target: row[1] }).collect())
}

fn method_name(method: Method) -> &'static str {
    match method {
        Method::SkeletonAligned => "skeleton",
        Method::Biharmonic => "biharmonic",
    }
}

fn method_of(name: &str) -> PyResult<Method> {
    Method::ALL.into_iter().find(|&method| method_name(method) == name).ok_or_else(|| {
        let names = Method::ALL.map(method_name).join(", ");
        InvalidParameter::new_err(format!("method is {name:?}, but must be one of {names}"))
    })
}

fn match_points_name(points: MatchPoints) -> &'static str {
    match points {
        MatchPoints::Surface => "surface",
        MatchPoints::Vertices => "vertices",
    }
}

fn match_points_of(name: &str) -> PyResult<MatchPoints> {
    MatchPoints::ALL.into_iter().find(|&points| match_points_name(points) == name).ok_or_else(|| {
        let names = MatchPoints::ALL.map(match_points_name).join(", ");
        InvalidParameter::new_err(format!("match_points is {name:?}, but must be one of {names}"))
    })
}
