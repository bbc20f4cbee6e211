//! NumPy arrays in (any array-like, cast and copied once) and out (moved, read-only).

use numpy::ndarray::ArrayView1;
use numpy::{AllowTypeChange, Element, PyArray1, PyArrayLike1, PyArrayLike2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::InvalidParameter;

/// A 1-D argument of any number type.
pub type Vector<'py, T> = PyArrayLike1<'py, T, AllowTypeChange>;
/// A 2-D argument of any number type.
pub type Matrix<'py, T> = PyArrayLike2<'py, T, AllowTypeChange>;

/// Rows of an (N, 3) array; `name` is the argument's.
pub fn triples<T: Element + Copy>(array: &Matrix<'_, T>, name: &str) -> PyResult<Vec<[T; 3]>> {
    rows_of(array, name, |row| [row[0], row[1], row[2]])
}

/// Rows of an (N, 2) array; `name` is the argument's.
pub fn pairs<T: Element + Copy>(array: &Matrix<'_, T>, name: &str) -> PyResult<Vec<[T; 2]>> {
    rows_of(array, name, |row| [row[0], row[1]])
}

fn rows_of<T: Element, const N: usize>(
    array: &Matrix<'_, T>,
    name: &str,
    row: impl Fn(ArrayView1<'_, T>) -> [T; N],
) -> PyResult<Vec<[T; N]>> {
    let shape = array.shape();
    if shape[1] != N {
        let (found, columns) = (shape[0], shape[1]);
        return Err(InvalidParameter::new_err(format!("{name} must have shape (N, {N}), not ({found}, {columns})")));
    }
    Ok(array.as_array().rows().into_iter().map(row).collect())
}

/// Entries of a 1-D array.
pub fn entries<T: Element + Copy>(array: &Vector<'_, T>) -> Vec<T> {
    array.as_array().iter().copied().collect()
}

/// Moves `values` into a read-only NumPy array.
pub fn read_only<T: Element>(py: Python<'_>, values: Vec<T>) -> PyResult<Py<PyArray1<T>>> {
    let array = PyArray1::from_vec(py, values);
    array.call_method1("setflags", (false,))?;
    Ok(array.unbind())
}
