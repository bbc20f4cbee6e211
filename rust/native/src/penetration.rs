//! `penetration`: how deep a posed garment lies inside a posed body.

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use skinwright_core::penetration::{Skinned, depths_in_poses};

use crate::arrays::{self, Matrix, Stack, triples};
use crate::error::{InvalidParameter, enter};
use crate::memory;
use crate::ranges;
use crate::skinning::pose;
use crate::weights::Weights;

/// Depths (P, n) of a garment's vertices (n) below the closest triangle of a body, 0 outside, in each of P poses.
/// `pose_from_rest` (P * B, 4, 4) has the B bones' matrices, one pose after the other.
#[pyfunction]
#[pyo3(signature = (body_positions, body_triangles, body_weights, positions, weights, pose_from_rest, *, threads=0))]
#[expect(clippy::too_many_arguments, reason = "two skinned meshes and their poses")]
pub fn penetration<'py>(
    py: Python<'py>,
    body_positions: Matrix<'py, f32>,
    body_triangles: Matrix<'py, u32>,
    body_weights: &Weights,
    positions: Matrix<'py, f32>,
    weights: &Weights,
    pose_from_rest: Stack<'py, f64>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let (body_rest, rest) =
        (arrays::positions(&body_positions, "body_positions")?, arrays::positions(&positions, "positions")?);
    let triangles = triples(&body_triangles, "body_triangles")?;
    let (body_weights, weights) = (body_weights.to_core(py)?, weights.to_core(py)?);
    let (bones, matrices) = (weights.n_bones() as usize, pose(&pose_from_rest)?);
    if bones == 0 || matrices.len() % bones != 0 {
        return Err(InvalidParameter::new_err(format!("{} matrices are not poses of {bones} bones", matrices.len())));
    }
    let poses_of = matrices.len() / bones;
    memory::expect("Measuring depths", memory::of_penetration(rest.len(), poses_of, triangles.len()))?;
    let poses: Vec<_> = matrices.chunks(bones).map(<[_]>::to_vec).collect();
    let body = Skinned { rest: &body_rest, weights: &body_weights };
    let garment = Skinned { rest: &rest, weights: &weights };
    let depths = enter(py, threads, || depths_in_poses(body, &triangles, garment, &poses))?;
    PyArray1::from_vec(py, depths.concat()).reshape([poses.len(), rest.len()])
}
