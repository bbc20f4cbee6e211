//! `linear_blend`, and bone matrices from NumPy.

use glam::DAffine3;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use skinwright_core::skinning as core;

pub use crate::arrays::Stack;
use crate::arrays::{Matrix, triples};
use crate::error::{InvalidParameter, enter, to_python};
use crate::memory;
use crate::ranges;
use crate::weights::Weights;

/// One transform a bone from (B, 4, 4) row-major matrices.
pub fn pose(matrices: &Stack<'_, f64>) -> PyResult<Vec<DAffine3>> {
    let &[_, 4, 4] = matrices.shape() else {
        let shape = matrices.shape();
        return Err(InvalidParameter::new_err(format!("pose_from_rest must have shape (B, 4, 4), not {shape:?}")));
    };
    let matrices = matrices.as_array();
    let rows = |m: numpy::ndarray::ArrayView2<'_, f64>| std::array::from_fn(|r| std::array::from_fn(|c| m[[r, c]]));
    let rows: Vec<[[f64; 4]; 4]> = matrices.outer_iter().map(rows).collect();
    core::pose_from_matrices(&rows).map_err(to_python)
}

/// Moves rows of three into an (N, 3) array.
pub fn vectors(py: Python<'_>, rows: Vec<[f32; 3]>) -> PyResult<Bound<'_, PyArray2<f32>>> {
    let shape = [rows.len(), 3];
    PyArray1::from_vec(py, rows.into_flattened()).reshape(shape)
}

/// Linear blend skinning as Blender's Armature modifier does it: the sum of the bones' transforms times the weights,
/// divided by the weights' sum; an unweighted vertex stays.
#[pyfunction]
#[pyo3(signature = (rest_positions, weights, pose_from_rest, *, threads=0))]
pub fn linear_blend<'py>(
    py: Python<'py>,
    rest_positions: Matrix<'py, f32>,
    weights: &Weights,
    pose_from_rest: Stack<'py, f64>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let (rest, pose) = (triples(&rest_positions, "rest_positions")?, pose(&pose_from_rest)?);
    let weights = weights.to_core(py)?;
    memory::expect("Posing", memory::of_skinning(rest.len()))?;
    vectors(py, enter(py, threads, || core::linear_blend(&rest, &weights, &pose))?)
}

/// Dual quaternion skinning as Blender's Armature modifier does it with Preserve Volume. `rest_bones` (B, 4, 4), the bones'
/// rest matrices, matter only where bones scale.
#[pyfunction]
#[pyo3(signature = (rest_positions, weights, pose_from_rest, *, rest_bones=None, threads=0))]
pub fn dual_quaternion_blend<'py>(
    py: Python<'py>,
    rest_positions: Matrix<'py, f32>,
    weights: &Weights,
    pose_from_rest: Stack<'py, f64>,
    rest_bones: Option<Stack<'py, f64>>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let (rest, matrices) = (triples(&rest_positions, "rest_positions")?, pose(&pose_from_rest)?);
    let (weights, bones) = (weights.to_core(py)?, rest_bones.as_ref().map(pose).transpose()?);
    memory::expect("Posing", memory::of_skinning(rest.len()))?;
    vectors(py, enter(py, threads, || core::dual_quaternion_blend(&rest, &weights, &matrices, bones.as_deref()))?)
}
