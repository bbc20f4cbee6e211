//! Skin weights as CSR arrays.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

use crate::arrays::{Matrix, Vector, entries, read_only};
use crate::error::{InvalidParameter, to_python};
use crate::ranges::{self, MOST_BONES};

/// Skin weights as CSR: row i of `indptr` (V+1) spans the influences of vertex i in `bones` and `values` (nnz).
#[pyclass(frozen, module = "skinwright_native")]
pub struct Weights {
    indptr: Py<PyArray1<u32>>,
    bones: Py<PyArray1<u32>>,
    values: Py<PyArray1<f32>>,
    n_bones: u32,
}

impl Weights {
    pub fn from_core(py: Python<'_>, weights: skinwright_core::Weights) -> PyResult<Self> {
        let n_bones = weights.n_bones();
        let (indptr, bones, values) = weights.into_arrays();
        let (bones, values) = (read_only(py, bones)?, read_only(py, values)?);
        Ok(Self { indptr: read_only(py, indptr)?, bones, values, n_bones })
    }

    pub fn to_core(&self, py: Python<'_>) -> PyResult<skinwright_core::Weights> {
        let (indptr, bones) = (self.indptr.bind(py).to_vec()?, self.bones.bind(py).to_vec()?);
        let values = self.values.bind(py).to_vec()?;
        skinwright_core::Weights::new(indptr, bones, values, self.n_bones).map_err(to_python)
    }
}

#[pymethods]
impl Weights {
    #[new]
    fn new(
        py: Python<'_>,
        indptr: Vector<'_, u32>,
        bones: Vector<'_, u32>,
        values: Vector<'_, f32>,
        #[pyo3(from_py_with = ranges::n_bones)] n_bones: u32,
    ) -> PyResult<Self> {
        let (indptr, bones, values) = (entries(&indptr), entries(&bones), entries(&values));
        let weights = skinwright_core::Weights::new(indptr, bones, values, n_bones).map_err(to_python)?;
        Self::from_core(py, weights)
    }

    /// The non-zero entries of a (V, n_bones) array.
    #[staticmethod]
    fn from_dense(py: Python<'_>, array: Matrix<'_, f32>) -> PyResult<Self> {
        let n_bones = ranges::count("the number of columns", array.shape()[1] as i64, 0..=MOST_BONES)? as u32;
        let (mut indptr, mut bones, mut values) = (vec![0], Vec::new(), Vec::new());
        for row in array.as_array().rows() {
            for (bone, &value) in row.iter().enumerate().filter(|&(_, &value)| value != 0.0) {
                bones.push(bone as u32);
                values.push(value);
            }
            let end = u32::try_from(bones.len());
            indptr.push(end.map_err(|_| InvalidParameter::new_err("the array has more entries than can be counted"))?);
        }
        let weights = skinwright_core::Weights::new(indptr, bones, values, n_bones).map_err(to_python)?;
        Self::from_core(py, weights)
    }

    /// A dense (V, n_bones) float32 array; mind its size.
    fn to_dense<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let weights = self.to_core(py)?;
        let shape = [weights.vertex_count(), self.n_bones as usize];
        // NumPy's own refusal of memory would be a panic.
        if Vec::<f32>::new().try_reserve_exact(shape[0].saturating_mul(shape[1])).is_err() {
            let bytes = 4 * shape[0] as u64 * shape[1] as u64;
            return Err(PyMemoryError::new_err(format!("a dense array would take {bytes} bytes: keep the sparse one")));
        }
        let dense = PyArray2::zeros(py, shape, false);
        {
            let mut rows = dense.readwrite();
            for (i, mut row) in rows.as_array_mut().rows_mut().into_iter().enumerate() {
                let (bones, values) = weights.row(i);
                for (&bone, &value) in std::iter::zip(bones, values) {
                    row[bone as usize] += value;
                }
            }
        }
        Ok(dense)
    }

    #[getter]
    fn indptr(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.indptr.clone_ref(py)
    }

    #[getter]
    fn bones(&self, py: Python<'_>) -> Py<PyArray1<u32>> {
        self.bones.clone_ref(py)
    }

    #[getter]
    fn values(&self, py: Python<'_>) -> Py<PyArray1<f32>> {
        self.values.clone_ref(py)
    }

    #[getter]
    fn n_bones(&self) -> u32 {
        self.n_bones
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.indptr.bind(py).len() - 1
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let influences = self.bones.bind(py).len();
        format!("Weights({} vertices, {influences} influences, {} bones)", self.__len__(py), self.n_bones)
    }
}
