//! What a transfer returns to Python.

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use skinwright_core::transfer as core;

use crate::arrays::read_only;
use crate::settings::policy_name;
use crate::weights::Weights;

/// What a transfer returns; every array has one entry per target vertex.
#[pyclass(frozen, get_all, module = "skinwright_native")]
pub struct Transfer {
    weights: Py<Weights>,
    matched: Py<PyArray1<bool>>,
    confidence: Py<PyArray1<f32>>,
    distance: Py<PyArray1<f32>>,
    angle: Py<PyArray1<f32>>,
    raw_minimum: f64,
    report: Py<PyDict>,
}

impl Transfer {
    pub(crate) fn of(py: Python<'_>, transfer: core::Transfer) -> PyResult<Self> {
        Ok(Self {
            raw_minimum: transfer.report.raw_minimum,
            report: report_dict(py, &transfer.report)?.unbind(),
            weights: Py::new(py, Weights::from_core(py, transfer.weights)?)?,
            matched: read_only(py, transfer.matched)?,
            confidence: read_only(py, transfer.confidence)?,
            distance: read_only(py, transfer.distances)?,
            angle: read_only(py, transfer.angles)?,
        })
    }
}

fn report_dict<'py>(py: Python<'py>, report: &core::Report) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("vertices", report.vertices)?;
    dict.set_item("matched", report.matched)?;
    dict.set_item("inpainted", report.inpainted)?;
    dict.set_item("loose", report.loose)?;
    dict.set_item("welded", report.welded)?;
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
    dict.set_item("rigid_islands", report.rigid_islands)?;
    dict.set_item("blocks", report.blocks)?;
    dict.set_item("factored_blocks", report.factored_blocks)?;
    dict.set_item("solved_near", report.solved_near)?;
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
