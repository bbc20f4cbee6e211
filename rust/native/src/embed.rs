//! `embed_skeleton`.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use skinwright_core::embed::{self as core, Donor, Method, Template};
use skinwright_core::{Progress, TriMesh};

use crate::arrays::{Matrix, Vector, entries, read_only, triples};
use crate::error::InvalidParameter;
use crate::job::call_and_job;
use crate::memory;
use crate::ranges;
use crate::weights::Weights;

/// A skeleton embedded into a mesh.
#[pyclass(frozen, get_all, module = "skinwright_native")]
pub struct Embedding {
    heads: Py<PyArray2<f32>>,
    tails: Py<PyArray2<f32>>,
    confidence: Py<PyArray1<f32>>,
    report: Py<PyDict>,
}

/// The checked arguments.
struct Input {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    heads: Vec<[f32; 3]>,
    tails: Vec<[f32; 3]>,
    parents: Vec<i32>,
    method: Method,
    donor: Option<DonorInput>,
}

/// The character that the bones were made for.
struct DonorInput {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    weights: skinwright_core::Weights,
    mirror: Option<Vec<i32>>,
    landmarks: Vec<[u32; 2]>,
}

impl DonorInput {
    /// Mesh and weights belong together; None if there is neither.
    fn new(
        py: Python<'_>,
        mesh: Option<(Matrix<'_, f32>, Matrix<'_, u32>)>,
        weights: Option<&Weights>,
        mirror: Option<Vector<'_, i32>>,
        landmarks: Option<Matrix<'_, u32>>,
    ) -> PyResult<Option<Self>> {
        let (Some((positions, triangles)), Some(weights)) = (mesh, weights) else { return Ok(None) };
        Ok(Some(Self {
            positions: triples(&positions, "donor_positions")?,
            triangles: triples(&triangles, "donor_triangles")?,
            weights: weights.to_core(py)?,
            mirror: mirror.map(|mirror| entries(&mirror)),
            landmarks: landmarks.map(|pairs| vertex_pairs(&pairs)).transpose()?.unwrap_or_default(),
        }))
    }
}

/// (L, 2).
fn vertex_pairs(array: &Matrix<'_, u32>) -> PyResult<Vec<[u32; 2]>> {
    let &[_, 2] = array.shape() else {
        return Err(InvalidParameter::new_err(format!("landmarks must have shape (L, 2), not {:?}", array.shape())));
    };
    Ok(array.as_array().rows().into_iter().map(|row| [row[0], row[1]]).collect())
}

impl Input {
    fn new(
        positions: &Matrix<'_, f32>,
        triangles: &Matrix<'_, u32>,
        heads: &Matrix<'_, f32>,
        tails: &Matrix<'_, f32>,
        parents: &Vector<'_, i32>,
        method: &str,
        donor: Option<DonorInput>,
    ) -> PyResult<Self> {
        let input = Self {
            positions: triples(positions, "positions")?,
            triangles: triples(triangles, "triangles")?,
            heads: triples(heads, "template_heads")?,
            tails: triples(tails, "template_tails")?,
            parents: entries(parents),
            method: method_of(method)?,
            donor,
        };
        let of_donor = input.donor.as_ref().map_or(0, |donor| donor.positions.len());
        memory::expect("Embedding a skeleton", memory::of_embedding(input.positions.len(), of_donor))?;
        Ok(input)
    }

    fn run(&self, progress: &Progress) -> skinwright_core::Result<core::Embedding> {
        let mesh = TriMesh::new(&self.positions, &self.triangles, "rest")?;
        let template = Template { heads: &self.heads, tails: &self.tails, parents: &self.parents };
        let Some(donor) = self.donor.as_ref().filter(|_| self.method == Method::Template) else {
            return core::embed_skeleton(&mesh, &template, self.method, progress);
        };
        let donor = Donor {
            mesh: TriMesh::new(&donor.positions, &donor.triangles, "template")?,
            weights: &donor.weights,
            mirror: donor.mirror.as_deref(),
            landmarks: &donor.landmarks,
        };
        core::embed_from_character(&mesh, &template, &donor, progress)
    }
}

call_and_job! {
    /// Puts the bones of a template into a mesh that has none.
    embed_skeleton -> Embedding,
    /// The same on threads of its own, to be polled.
    start_embed_skeleton,
    signature = (positions, triangles, template_heads, template_tails, parents, *, method="medial", threads=0,
        donor_positions=None, donor_triangles=None, donor_weights=None, mirror=None, landmarks=None),
    |py, threads,
        positions: Matrix<'_, f32>,
        triangles: Matrix<'_, u32>,
        template_heads: Matrix<'_, f32>,
        template_tails: Matrix<'_, f32>,
        parents: Vector<'_, i32>,
        method: &str,
        #[pyo3(from_py_with = ranges::threads)] threads: usize,
        donor_positions: Option<Matrix<'_, f32>>,
        donor_triangles: Option<Matrix<'_, u32>>,
        donor_weights: Option<&Weights>,
        mirror: Option<Vector<'_, i32>>,
        landmarks: Option<Matrix<'_, u32>>,
    | {
        let donor = DonorInput::new(py, donor_positions.zip(donor_triangles), donor_weights, mirror, landmarks)?;
        Input::new(&positions, &triangles, &template_heads, &template_tails, &parents, method, donor)?
    }
}

fn method_name(method: Method) -> &'static str {
    match method {
        Method::Medial => "medial",
        Method::Template => "template",
    }
}

fn method_of(name: &str) -> PyResult<Method> {
    Method::ALL.into_iter().find(|&method| method_name(method) == name).ok_or_else(|| {
        let names = Method::ALL.map(method_name).join(", ");
        InvalidParameter::new_err(format!("method is {name:?}, but must be one of {names}"))
    })
}

fn present(py: Python<'_>, result: core::Embedding) -> PyResult<Embedding> {
    let (report, dict) = (result.report, PyDict::new(py));
    dict.set_item("places", report.places)?;
    dict.set_item("main_joints", report.main_joints)?;
    dict.set_item("symmetric", report.symmetric)?;
    dict.set_item("outside", report.outside)?;
    dict.set_item("penalty", report.penalty)?;
    dict.set_item("seconds", report.seconds)?;
    Ok(Embedding {
        heads: points(py, result.heads)?,
        tails: points(py, result.tails)?,
        confidence: read_only(py, result.confidence)?,
        report: dict.unbind(),
    })
}

/// A read-only (N, 3) array.
fn points(py: Python<'_>, points: Vec<[f32; 3]>) -> PyResult<Py<PyArray2<f32>>> {
    let count = points.len();
    let array = PyArray1::from_vec(py, points.into_flattened()).reshape([count, 3])?;
    array.call_method1("setflags", (false,))?;
    Ok(array.unbind())
}
