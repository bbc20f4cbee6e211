//! `biharmonic_embedding`.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use skinwright_core::TriMesh;
use skinwright_core::biharmonic::BiharmonicEmbedding;

use crate::arrays::{Matrix, triples};
use crate::error::enter_stoppable;
use crate::ranges;

/// Coordinates (V, n_pairs) in which the Euclidean distance is the biharmonic distance, each island by itself.
#[pyfunction]
#[pyo3(signature = (positions, triangles, *, n_pairs=100, threads=0))]
pub fn biharmonic_embedding<'py>(
    py: Python<'py>,
    positions: Matrix<'_, f32>,
    triangles: Matrix<'_, u32>,
    #[pyo3(from_py_with = ranges::pairs)] n_pairs: usize,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (positions, triangles) = (triples(&positions, "positions")?, triples(&triangles, "triangles")?);
    let embedding = enter_stoppable(py, threads, |progress| {
        let mesh = TriMesh::new(&positions, &triangles, "given")?;
        BiharmonicEmbedding::new(&mesh, n_pairs, progress)
    })?;
    PyArray1::from_vec(py, embedding.into_values()).reshape([positions.len(), n_pairs])
}
