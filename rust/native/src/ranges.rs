//! Numbers that callers choose: each has one range, the same as the add-on declares, and is checked before anything is
//! allocated or started by it.

use std::fmt::Display;
use std::ops::RangeInclusive;

use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use skinwright_core::sculpt::MAX_MEMBERS;

use crate::error::InvalidParameter;

/// More than any armature has; what is kept per bone stays small beside what is kept per vertex.
pub const MOST_BONES: i64 = 1 << 20;

/// A whole number from Python. What is beyond 64 bits becomes the nearest end, which no range holds.
pub fn whole(object: &Bound<'_, PyAny>) -> PyResult<i64> {
    match object.extract::<i64>() {
        Err(error) if error.is_instance_of::<PyOverflowError>(object.py()) => {
            Ok(if object.lt(0)? { i64::MIN } else { i64::MAX })
        }
        extracted => extracted,
    }
}

/// `value` if it lies in its range. Not a number lies in none.
pub fn within<T: PartialOrd + Display>(name: &str, value: T, range: RangeInclusive<T>) -> PyResult<T> {
    if range.contains(&value) {
        return Ok(value);
    }
    let (least, most) = (range.start(), range.end());
    Err(InvalidParameter::new_err(format!("{name} is {value}, but must lie between {least} and {most}")))
}

/// The same for a count or an index.
pub fn count(name: &str, value: i64, range: RangeInclusive<i64>) -> PyResult<usize> {
    within(name, value, range).map(|value| usize::try_from(value).expect("a range of counts"))
}

/// Threads to work on: 0 for all of the machine's, and never more than it has.
pub fn threads(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    let most = std::thread::available_parallelism().map_or(1, usize::from);
    Ok(count("threads", whole(object)?, 0..=i64::MAX - 1)?.min(most))
}

/// Columns of weights.
pub fn n_bones(object: &Bound<'_, PyAny>) -> PyResult<u32> {
    Ok(count("n_bones", whole(object)?, 0..=MOST_BONES)? as u32)
}

/// Members of a vertex after desparsification.
pub fn members(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    count("n", whole(object)?, 1..=MAX_MEMBERS as i64)
}

/// Most influences per vertex, 0 for no limit.
pub fn influences(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    count("max_influences", whole(object)?, 0..=255)
}

/// Passes of smoothing.
pub fn smoothing(object: &Bound<'_, PyAny>) -> PyResult<u32> {
    Ok(count("smoothing_iterations", whole(object)?, 0..=1000)? as u32)
}

/// Passes of the proximal solve of a stroke.
pub fn passes(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    count("passes", whole(object)?, 1..=100)
}

/// Eigenpairs of a surface: what is allocated grows with them.
pub fn pairs(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    count("n_pairs", whole(object)?, 1..=2000)
}

/// Rounds of an alternation.
pub fn rounds(object: &Bound<'_, PyAny>) -> PyResult<usize> {
    count("rounds", whole(object)?, 0..=1000)
}

/// The number of a pose, None for the one added last.
pub fn pose(object: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    if object.is_none() { Ok(None) } else { count("pose", whole(object)?, 0..=i64::MAX - 1).map(Some) }
}

/// The pull of a stroke towards the old weights. What is not more than 0 is the core's to refuse.
pub fn kappa(object: &Bound<'_, PyAny>) -> PyResult<f64> {
    let value: f64 = object.extract()?;
    if value > 0.0 { within("kappa", value, 1e-6..=1.0) } else { Ok(value) }
}
