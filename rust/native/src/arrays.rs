//! NumPy arrays in (any array-like, cast and copied once) and out (moved, read-only).

use numpy::{AllowTypeChange, Element, PyArray1, PyArrayLike1, PyArrayLike2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::InvalidParameter;

/// A 1-D argument of any number type.
pub type Vector<'py, T> = PyArrayLike1<'py, T, AllowTypeChange>;
/// A 2-D argument of any number type.
pub type Matrix<'py, T> = PyArrayLike2<'py, T, AllowTypeChange>;

/// Rows of an (N, 3) array; `name` is the argument's.
pub fn triples<T: Element + Copy>(array: &Matrix<'_, T>, name: &str) -> PyResult<Vec<[T; 3]>> {
    if array.shape()[1] != 3 {
        let shape = array.shape();
        return Err(InvalidParameter::new_err(format!(
            "{name} must have shape (N, 3), not ({}, {})",
            shape[0], shape[1]
        )));
    }
    Ok(array.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
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
