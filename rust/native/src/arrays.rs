//! NumPy arrays in (any array-like, cast exactly and copied once) and out (moved, read-only).

use std::ops::Deref;

use numpy::ndarray::{ArrayView1, Dimension, Ix1, Ix2, Ix3};
use numpy::{AllowTypeChange, Element, PyArray1, PyArrayLike, PyReadonlyArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error::{InvalidMesh, InvalidParameter};
use crate::memory;

/// A 1-D argument of any number type.
pub type Vector<'py, T> = Array<'py, T, Ix1>;
/// A 2-D argument of any number type.
pub type Matrix<'py, T> = Array<'py, T, Ix2>;
/// A 3-D argument of any number type.
pub type Stack<'py, T> = Array<'py, T, Ix3>;

/// An array argument. Whole numbers are taken exactly: what does not fit the type is refused, never wrapped or cut.
pub struct Array<'py, T: Element, D: Dimension>(PyArrayLike<'py, T, D, AllowTypeChange>);

impl<'py, T: Element, D: Dimension> Deref for Array<'py, T, D> {
    type Target = PyReadonlyArray<'py, T, D>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

/// What arrays hold.
pub trait Number: Element {
    /// Smallest and largest value of a type of whole numbers.
    const WHOLE: Option<(f64, f64)> = None;
}
impl Number for bool {}
impl Number for f32 {}
impl Number for f64 {}
impl Number for u8 {
    const WHOLE: Option<(f64, f64)> = Some((0.0, 255.0));
}
impl Number for u32 {
    const WHOLE: Option<(f64, f64)> = Some((0.0, 4_294_967_295.0));
}
impl Number for i32 {
    const WHOLE: Option<(f64, f64)> = Some((-2_147_483_648.0, 2_147_483_647.0));
}
impl Number for i64 {
    // As far as a double tells whole numbers apart.
    const WHOLE: Option<(f64, f64)> = Some((-9_007_199_254_740_992.0, 9_007_199_254_740_992.0));
}

impl<'py, T: Number, D: Dimension + 'py> FromPyObject<'_, 'py> for Array<'py, T, D>
where
    PyArrayLike<'py, T, D, AllowTypeChange>: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Some((least, most)) = T::WHOLE {
            check_whole(&object, least, most)?;
        }
        let array: PyArrayLike<'py, T, D, AllowTypeChange> = object.extract()?;
        memory::expect_copies((array.len() * size_of::<T>()) as u64)?;
        Ok(Self(array))
    }
}

/// Refuses entries that a type of whole numbers cannot hold.
fn check_whole(object: &Bound<'_, PyAny>, least: f64, most: f64) -> PyResult<()> {
    let array = object.py().import("numpy")?.call_method1("asarray", (object,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if array.getattr("size")?.extract::<usize>()? == 0 {
        return Ok(());
    }
    if !"iufb".contains(&kind) {
        return Err(PyTypeError::new_err("an array of whole numbers is needed"));
    }
    if kind == "f"
        && !array.call_method1("__eq__", (array.call_method0("round")?,))?.call_method0("all")?.is_truthy()?
    {
        return Err(InvalidParameter::new_err("an array that must hold whole numbers holds fractions"));
    }
    for end in ["min", "max"] {
        let value: f64 = array.call_method0(end)?.extract()?;
        if !(least..=most).contains(&value) {
            let holds = format!("an array of indices holds {value}, but must hold numbers from {least} to {most}");
            return Err(InvalidParameter::new_err(holds));
        }
    }
    Ok(())
}

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

/// Refuses numbers that are not finite; `name` is the argument's.
pub fn check_finite<'a>(numbers: impl IntoIterator<Item = &'a f64>, name: &str) -> PyResult<()> {
    if numbers.into_iter().all(|x| x.is_finite()) {
        return Ok(());
    }
    Err(InvalidParameter::new_err(format!("{name} has a number that is not finite")))
}

/// Rows of an (N, 3) array of positions, all of them finite.
pub fn positions(array: &Matrix<'_, f32>, name: &str) -> PyResult<Vec<[f32; 3]>> {
    let rows = triples(array, name)?;
    if let Some(vertex) = rows.iter().position(|row| row.iter().any(|x| !x.is_finite())) {
        return Err(InvalidMesh::new_err(format!("{name} has a position that is not finite at vertex {vertex}")));
    }
    Ok(rows)
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
