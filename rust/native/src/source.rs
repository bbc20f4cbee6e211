//! Transfer by weight inpainting: `Source` and the one-off `transfer_weights`.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use skinwright_core::transfer as core;

use crate::arrays::{Matrix, triples};
use crate::error::{enter, enter_stoppable};
use crate::inpainting::{expect_solve, target_mesh};
use crate::memory;
use crate::ranges;
use crate::settings::keywords;
use crate::transfer::Transfer;
use crate::weights::Weights;

/// Triangles (Q,), barycentric coordinates (Q, 3) and distances (Q,).
type ClosestPoints<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);
/// A body prepared once (checks, BVH, normals) for any number of garments.
#[pyclass(frozen, module = "skinwright_native")]
pub struct Source {
    pub(crate) core: core::Source,
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
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
    ) -> PyResult<Self> {
        let (positions, triangles) = (triples(&positions, "positions")?, triples(&triangles, "triangles")?);
        let weights = weights.to_core(py)?;
        memory::expect("Preparing the source", memory::of_source(positions.len(), triangles.len()))?;
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
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
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
    #[pyo3(signature = (target_positions, target_triangles, *, target_edges=None, threads=0, **settings))]
    fn transfer(
        &self,
        py: Python<'_>,
        target_positions: Matrix<'_, f32>,
        target_triangles: Matrix<'_, u32>,
        target_edges: Option<Matrix<'_, u32>>,
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Transfer> {
        let (settings, mask) = keywords(settings)?;
        let target = target_mesh(&target_positions, &target_triangles, target_edges.as_ref())?;
        let mask = mask.as_deref();
        let (mut inpainting, matched) = enter_stoppable(py, threads, |progress| {
            let mut inpainting = core::Inpainting::new(self.core.clone(), target, &settings, progress)?;
            let matched = inpainting.matched(mask, &settings)?;
            Ok((inpainting, matched))
        })?;
        expect_solve(&matched)?;
        Transfer::of(py, enter_stoppable(py, threads, |progress| inpainting.solve(mask, &settings, progress))?)
    }
}

/// Transfers skin weights from a source mesh to a target mesh by weight inpainting, once.
#[pyfunction]
#[pyo3(signature = (source_positions, source_triangles, source_weights, target_positions, target_triangles, *,
    target_edges=None, threads=0, **settings),
    text_signature = "(source_positions, source_triangles, source_weights, target_positions, target_triangles, *, \
    target_edges=None, method='paper', softness=0.7, max_distance=None, relative_max_distance=0.05, max_normal_angle=0.6108652381980153, match_flipped_normals=True, average_ties=False, \
    mask=None, relative_weld_tolerance=1e-06, smoothness_length=None, relative_smoothness_length=0.05, smoothing_iterations=0, \
    smoothing_factor=0.2, max_influences=0, island_policy='bridge', small_islands='auto', threads=0)")]
#[expect(clippy::too_many_arguments, reason = "the arguments of the Python function")]
pub fn transfer_weights(
    py: Python<'_>,
    source_positions: Matrix<'_, f32>,
    source_triangles: Matrix<'_, u32>,
    source_weights: &Weights,
    target_positions: Matrix<'_, f32>,
    target_triangles: Matrix<'_, u32>,
    target_edges: Option<Matrix<'_, u32>>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
    settings: Option<&Bound<'_, PyDict>>,
) -> PyResult<Transfer> {
    let source = Source::new(py, source_positions, source_triangles, source_weights, threads)?;
    source.transfer(py, target_positions, target_triangles, target_edges, threads, settings)
}
