//! `automatic_weights`.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use skinwright_core::autoskin::{self as core, Method, Settings, Skeleton};
use skinwright_core::{Progress, TriMesh};

use crate::arrays::{Matrix, Vector, entries, triples};
use crate::desparsify::segments;
use crate::error::{InvalidParameter, to_python};
use crate::job::call_and_job;
use crate::memory;
use crate::ranges;
use crate::skinning::Stack;
use crate::weights::Weights;

/// Automatic weights and what is to be said about them.
#[pyclass(frozen, get_all, module = "skinwright_native")]
pub struct AutoWeights {
    weights: Py<Weights>,
    report: Py<PyDict>,
}

/// The checked arguments.
struct Input {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    segments: Vec<[[f32; 3]; 2]>,
    parents: Vec<i32>,
    settings: Settings,
}

impl Input {
    fn run(&self, progress: &Progress) -> skinwright_core::Result<core::AutoWeights> {
        let mesh = TriMesh::new(&self.positions, &self.triangles, "rest")?;
        let skeleton = Skeleton { segments: &self.segments, parents: &self.parents };
        core::automatic_weights(&mesh, &skeleton, &self.settings, progress)
    }
}

call_and_job! {
    /// Computes weights for the bones of an armature from scratch.
    automatic_weights -> AutoWeights,
    /// The same on threads of its own, to be polled.
    start_automatic_weights,
    signature = (positions, triangles, bone_segments, bone_parents, *, method="heat", max_influences=4,
        resolution=128.0, stiffness=5.0, threads=0),
    |py, threads,
        positions: Matrix<'_, f32>,
        triangles: Matrix<'_, u32>,
        bone_segments: Stack<'_, f32>,
        bone_parents: Vector<'_, i32>,
        method: &str,
        #[pyo3(from_py_with = ranges::influences)] max_influences: usize,
        resolution: f64,
        stiffness: f64,
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
    | {
        let settings = settings(method, max_influences, resolution, stiffness)?;
        input(&positions, &triangles, &bone_segments, &bone_parents, settings)?
    }
}

fn settings(method: &str, max_influences: usize, resolution: f64, stiffness: f64) -> PyResult<Settings> {
    let settings = Settings { method: method_of(method)?, max_influences, resolution, stiffness };
    settings.check().map_err(to_python)?;
    Ok(settings)
}

fn input(
    positions: &Matrix<'_, f32>,
    triangles: &Matrix<'_, u32>,
    bone_segments: &Stack<'_, f32>,
    bone_parents: &Vector<'_, i32>,
    settings: Settings,
) -> PyResult<Input> {
    let input = Input {
        positions: triples(positions, "positions")?,
        triangles: triples(triangles, "triangles")?,
        segments: segments(bone_segments)?,
        parents: entries(bone_parents),
        settings,
    };
    let bytes = memory::of_automatic(&input.positions, settings.resolution, input.segments.len());
    memory::expect("Automatic weights", bytes)?;
    Ok(input)
}

fn method_name(method: Method) -> &'static str {
    match method {
        Method::Heat => "heat",
        Method::Geodesic => "geodesic",
        Method::Euclidean => "euclidean",
    }
}

fn method_of(name: &str) -> PyResult<Method> {
    Method::ALL.into_iter().find(|&method| method_name(method) == name).ok_or_else(|| {
        let names = Method::ALL.map(method_name).join(", ");
        InvalidParameter::new_err(format!("method is {name:?}, but must be one of {names}"))
    })
}

fn present(py: Python<'_>, result: core::AutoWeights) -> PyResult<AutoWeights> {
    let (report, dict) = (result.report, PyDict::new(py));
    dict.set_item("vertices", report.vertices)?;
    dict.set_item("distinct", report.distinct)?;
    dict.set_item("unweighted", report.unweighted)?;
    dict.set_item("bones_used", report.bones_used)?;
    dict.set_item("bones_outside", report.bones_outside)?;
    dict.set_item("most_influences", report.most_influences)?;
    dict.set_item("cells", report.cells)?;
    dict.set_item("cell_size", report.cell_size)?;
    dict.set_item("residual", report.residual)?;
    let seconds = PyDict::new(py);
    for (stage, spent) in report.seconds {
        seconds.set_item(stage, spent)?;
    }
    dict.set_item("seconds", seconds)?;
    Ok(AutoWeights { weights: Py::new(py, Weights::from_core(py, result.weights)?)?, report: dict.unbind() })
}
