//! Values known at some vertices -> values at all of them.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use skinwright_core::Weld;
use skinwright_core::fill::{Constraint, Fill, Row};

use crate::arrays::{Matrix, Vector, entries, triples};
use crate::error::{InvalidParameter, enter_stoppable};
use crate::memory;
use crate::ranges;

/// Fills in what is not known. `kinds` (V,): 0 free, 1 fixed, 2 soft. `rows` (V, C) hold the known values, `confidence` (V,)
/// the b of `b |w - s|^2` of soft vertices. `weld` (V,): another vertex that is one with this one (or itself).
#[pyfunction]
#[pyo3(signature = (positions, triangles, kinds, rows, *, confidence=None, length=0.0, weld=None, threads=0))]
#[expect(clippy::too_many_arguments, reason = "the arguments of the Python function")]
pub fn fill<'py>(
    py: Python<'py>,
    positions: Matrix<'_, f32>,
    triangles: Matrix<'_, u32>,
    kinds: Vector<'_, u8>,
    rows: Matrix<'_, f64>,
    confidence: Option<Vector<'_, f64>>,
    length: f64,
    weld: Option<Vector<'_, u32>>,
    #[pyo3(from_py_with = ranges::threads)] threads: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (positions, triangles) = (triples(&positions, "positions")?, triples(&triangles, "triangles")?);
    let shape = [positions.len(), rows.shape()[1]];
    expect_entries("rows", rows.shape()[0], shape[0])?;
    memory::expect("Filling in", memory::of_fill(shape[0], shape[1]))?;
    let constraints = constraints(&entries(&kinds), confidence.map(|b| entries(&b)))?;
    let weld = weld.map(|weld| weld_of(&entries(&weld), shape[0])).transpose()?;
    let rows: Vec<f64> = rows.as_array().iter().copied().collect();
    if let Some(at) = rows.iter().position(|x| !x.is_finite()) {
        let vertex = at / shape[1];
        return Err(InvalidParameter::new_err(format!("rows has a value that is not finite at vertex {vertex}")));
    }
    let values = enter_stoppable(py, threads, |progress| {
        let mut fill = Fill::new(positions, triangles, weld)?;
        let assembled = fill.assemble(constraints, length, progress)?;
        fill.factor(assembled, progress)?;
        let given = |i: u32, out: &mut Row| out.extend(std::iter::zip(0.., of_row(&rows, i as usize, shape[1])));
        let filled = fill.solve(&given, progress)?;
        let mut row = Row::new();
        let mut values = vec![f64::NAN; rows.len()];
        for (i, values) in values.chunks_exact_mut(shape[1].max(1)).enumerate() {
            row.clear();
            filled.append_row(i, &mut row);
            row.iter().for_each(|&(column, value)| values[column as usize] = value);
        }
        Ok(values)
    })?;
    PyArray1::from_vec(py, values).reshape(shape)
}

fn of_row(rows: &[f64], i: usize, columns: usize) -> impl Iterator<Item = f64> + '_ {
    rows[i * columns..(i + 1) * columns].iter().copied()
}

fn expect_entries(name: &str, found: usize, expected: usize) -> PyResult<()> {
    if found == expected {
        return Ok(());
    }
    Err(InvalidParameter::new_err(format!("{name} has {found} entries where {expected} are needed")))
}

fn constraints(kinds: &[u8], confidence: Option<Vec<f64>>) -> PyResult<Vec<Constraint>> {
    let confidence = confidence.unwrap_or_else(|| vec![0.0; kinds.len()]);
    expect_entries("confidence", confidence.len(), kinds.len())?;
    let constraint = |(i, (&kind, b))| match kind {
        0 => Ok(Constraint::Free),
        1 => Ok(Constraint::Fixed),
        2 => Ok(Constraint::Soft(b)),
        _ => Err(InvalidParameter::new_err(format!("kinds is {kind} at vertex {i}, but must be 0, 1 or 2"))),
    };
    std::iter::zip(kinds, confidence).enumerate().map(constraint).collect()
}

fn weld_of(other: &[u32], vertex_count: usize) -> PyResult<Weld> {
    expect_entries("weld", other.len(), vertex_count)?;
    match other.iter().find(|&&j| j as usize >= vertex_count) {
        Some(j) => Err(InvalidParameter::new_err(format!("weld names vertex {j}, but there are only {vertex_count}"))),
        None => Ok(Weld::new(other)),
    }
}
