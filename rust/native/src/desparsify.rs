//! `desparsify`.

use numpy::PyUntypedArrayMethods;
use pyo3::prelude::*;
use skinwright_core::TriMesh;
use skinwright_core::desparsify::{self as core, Method, Skeleton};

use crate::arrays::{Matrix, Vector, entries, triples};
use crate::error::{InvalidParameter, enter};
use crate::memory;
use crate::ranges;
use crate::skinning::Stack;
use crate::weights::Weights;

/// Gives every vertex exactly `n` members: its locked ones, the largest of the others, and new ones at weight zero.
#[pyfunction]
#[pyo3(signature = (weights, bone_parents, *, n=4, method="surface", positions=None, triangles=None,
    bone_segments=None, locked=None, threads=0))]
#[expect(clippy::too_many_arguments, reason = "the arguments of the Python function")]
pub fn desparsify(
    py: Python<'_>,
    weights: &Weights,
    bone_parents: Vector<'_, i32>,
    #[pyo3(from_py_with = ranges::members)] n: usize,
    method: &str,
    positions: Option<Matrix<'_, f32>>,
    triangles: Option<Matrix<'_, u32>>,
    bone_segments: Option<Stack<'_, f32>>,
    locked: Option<Vector<'_, bool>>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Weights> {
    let (method, weights, parents) = (method_of(method)?, weights.to_core(py)?, entries(&bone_parents));
    let positions = positions.map(|p| triples(&p, "positions")).transpose()?;
    let triangles = triangles.map(|t| triples(&t, "triangles")).transpose()?;
    let segments = bone_segments.map(|s| segments(&s)).transpose()?;
    if method == Method::Surface && (positions.is_none() || triangles.is_none() || segments.is_none()) {
        let needs = "method \"surface\" needs positions, triangles and bone_segments; \"hop\" does without them";
        return Err(InvalidParameter::new_err(needs));
    }
    let locked = locked.map(|l| entries(&l)).unwrap_or_default();
    memory::expect("Desparsification", memory::of_desparsify(weights.vertex_count(), n))?;
    let result = enter(py, threads, || {
        let mesh = match (&positions, &triangles) {
            (Some(positions), Some(triangles)) if method == Method::Surface => {
                Some(TriMesh::new(positions, triangles, "rest")?)
            }
            _ => None,
        };
        let skeleton = Skeleton { parents: &parents, segments: segments.as_deref().unwrap_or(&[]), locked: &locked };
        core::desparsify(&weights, method, n, &skeleton, mesh.as_ref())
    })?;
    Weights::from_core(py, result)
}

fn method_name(method: Method) -> &'static str {
    match method {
        Method::Hop => "hop",
        Method::Surface => "surface",
    }
}

fn method_of(name: &str) -> PyResult<Method> {
    Method::ALL.into_iter().find(|&method| method_name(method) == name).ok_or_else(|| {
        let names = Method::ALL.map(method_name).join(", ");
        InvalidParameter::new_err(format!("method is {name:?}, but must be one of {names}"))
    })
}

/// Head and tail of every bone from a (B, 2, 3) array.
fn segments(array: &Stack<'_, f32>) -> PyResult<Vec<[[f32; 3]; 2]>> {
    let &[_, 2, 3] = array.shape() else {
        let shape = array.shape();
        return Err(InvalidParameter::new_err(format!("bone_segments must have shape (B, 2, 3), not {shape:?}")));
    };
    let array = array.as_array();
    let segment = |s: numpy::ndarray::ArrayView2<'_, f32>| std::array::from_fn(|e| std::array::from_fn(|c| s[[e, c]]));
    Ok(array.outer_iter().map(segment).collect())
}
