//! The Python module `skinwright_native`.
use pyo3::prelude::*;

/// Skinwright's numerics.
#[pymodule]
mod skinwright_native {}
