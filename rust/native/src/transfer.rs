//! Transfer by weight inpainting: `Source`, `Inpainting`, `Transfer` and the one-off `transfer_weights`.

use std::sync::{Arc, Mutex, MutexGuard};

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use skinwright_core::Progress;
use skinwright_core::transfer::{self as core, IslandPolicy, Length, MaskValue, Settings};

use crate::arrays::{Matrix, Vector, entries, read_only, triples};
use crate::error::{InvalidParameter, enter};
use crate::job::Job;
use crate::weights::Weights;

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

/// An absolute length wins over the relative one.
fn length(absolute: Option<f64>, relative: f64) -> Length {
    absolute.map_or(Length::Relative(relative), Length::Absolute)
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
    fn new(
        py: Python<'_>,
        positions: Matrix<'_, f32>,
        triangles: Matrix<'_, u32>,
        weights: &Weights,
    ) -> PyResult<Self> {
        let (positions, triangles) = (triples(&positions, "positions")?, triples(&triangles, "triangles")?);
        let weights = weights.to_core(py)?;
        let core = enter(py, 0, || core::Source::new(&positions, triangles, weights))?;
        Ok(Self { core })
    }

    /// Transfers this body's weights to one garment. See `transfer_weights`.
    #[pyo3(signature = (target_positions, target_triangles, *, max_distance=None, relative_max_distance=0.05,
        max_normal_angle=35f64.to_radians(), match_flipped_normals=true, mask=None, smoothness_length=None,
        relative_smoothness_length=0.05, smoothing_iterations=0, smoothing_factor=0.2, max_influences=0,
        island_policy="bridge", threads=0))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of Python")]
    fn transfer(
        &self,
        py: Python<'_>,
        target_positions: Matrix<'_, f32>,
        target_triangles: Matrix<'_, u32>,
        max_distance: Option<f64>,
        relative_max_distance: f64,
        max_normal_angle: f64,
        match_flipped_normals: bool,
        mask: Option<Vector<'_, u8>>,
        smoothness_length: Option<f64>,
        relative_smoothness_length: f64,
        smoothing_iterations: u32,
        smoothing_factor: f64,
        max_influences: usize,
        island_policy: &str,
        threads: usize,
    ) -> PyResult<Transfer> {
        let settings = Settings {
            max_distance: length(max_distance, relative_max_distance),
            max_normal_angle,
            match_flipped_normals,
            smoothness_length: length(smoothness_length, relative_smoothness_length),
            smoothing_iterations,
            smoothing_factor,
            max_influences,
            island_policy: policy(island_policy)?,
        };
        let mask = mask_values(mask)?;
        let positions = triples(&target_positions, "target_positions")?;
        let triangles = triples(&target_triangles, "target_triangles")?;
        let source = self.core.clone();
        let (inpainting, transfer) =
            enter(py, threads, || core::transfer_weights(source, positions, triangles, mask.as_deref(), &settings))?;
        Closest::of(py, &inpainting)?.present(py, transfer)
    }
}
