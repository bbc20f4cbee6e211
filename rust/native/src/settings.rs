//! Settings of a transfer from keyword arguments.

use std::f64::consts::PI;

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use skinwright_core::transfer::{IslandPolicy, Length, MaskValue, MatchMethod, Settings, SmallIslands};

use crate::arrays::{Vector, entries};
use crate::error::{InvalidParameter, to_python};
use crate::ranges::{self, within};

/// The names Python uses for the policies.
pub(crate) fn policy_name(policy: IslandPolicy) -> &'static str {
    match policy {
        IslandPolicy::Bridge => "bridge",
        IslandPolicy::Nearest => "nearest",
        IslandPolicy::Rigid => "rigid",
        IslandPolicy::Skip => "skip",
    }
}

/// The names Python uses for the methods of matching.
fn method_name(method: MatchMethod) -> &'static str {
    match method {
        MatchMethod::ClosestPoint => "paper",
        MatchMethod::Confidence => "confidence",
    }
}

/// The names Python uses for what small islands become.
fn small_islands_name(choice: SmallIslands) -> &'static str {
    match choice {
        SmallIslands::Auto => "auto",
        SmallIslands::Rigid => "rigid",
        SmallIslands::Solved => "solved",
    }
}

/// The variant whose name is `value`, of all there are.
fn named<T: Copy, const N: usize>(setting: &str, value: &str, all: [T; N], name: fn(T) -> &'static str) -> PyResult<T> {
    all.into_iter().find(|&variant| name(variant) == value).ok_or_else(|| {
        let names = all.map(name).join(", ");
        InvalidParameter::new_err(format!("{setting} is {value:?}, but must be one of {names}"))
    })
}

/// Settings and mask from keyword arguments; what is absent keeps the core's default.
pub(crate) fn keywords(keywords: Option<&Bound<'_, PyDict>>) -> PyResult<(Settings, Option<Vec<MaskValue>>)> {
    let (mut settings, mut mask) = (Settings::default(), None);
    let (mut max_distance, mut smoothness_length) = (None, None);
    for (name, value) in keywords.into_iter().flatten() {
        let name: &str = &name.extract::<String>()?;
        match name {
            "max_distance" => max_distance = length(name, &value)?,
            "relative_max_distance" => settings.max_distance = Length::Relative(share(name, &value, 10.0)?),
            "max_normal_angle" => settings.max_normal_angle = share(name, &value, PI)?,
            "match_flipped_normals" => settings.match_flipped_normals = value.extract()?,
            "average_ties" => settings.average_ties = value.extract()?,
            "relative_weld_tolerance" => settings.weld_tolerance = Length::Relative(share(name, &value, 0.01)?),
            "mask" => mask = mask_values(value.extract()?)?,
            "smoothness_length" => smoothness_length = length(name, &value)?,
            "relative_smoothness_length" => settings.smoothness_length = Length::Relative(share(name, &value, 100.0)?),
            "smoothing_iterations" => settings.smoothing_iterations = ranges::smoothing(&value)?,
            "smoothing_factor" => settings.smoothing_factor = share(name, &value, 1.0)?,
            "max_influences" => settings.max_influences = ranges::influences(&value)?,
            "method" => settings.method = named(name, value.extract()?, MatchMethod::ALL, method_name)?,
            "softness" => settings.softness = within(name, value.extract()?, 0.05..=10.0)?,
            "island_policy" => {
                settings.island_policy = named(name, value.extract()?, IslandPolicy::ALL, policy_name)?;
            }
            "small_islands" => {
                settings.small_islands = named(name, value.extract()?, SmallIslands::ALL, small_islands_name)?;
            }
            unknown => return Err(PyTypeError::new_err(format!("there is no setting named {unknown:?}"))),
        }
    }
    // An absolute length wins over the relative one.
    settings.max_distance = max_distance.map_or(settings.max_distance, Length::Absolute);
    settings.smoothness_length = smoothness_length.map_or(settings.smoothness_length, Length::Absolute);
    settings.check().map_err(to_python)?;
    Ok((settings, mask))
}

/// A number from 0 to `most`.
fn share(name: &str, value: &Bound<'_, PyAny>, most: f64) -> PyResult<f64> {
    within(name, value.extract()?, 0.0..=most)
}

/// A length in world units, None for the relative one.
fn length(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    value.extract::<Option<f64>>()?.map(|length| within(name, length, 0.0..=1e9)).transpose()
}

fn mask_values(mask: Option<Vector<'_, u8>>) -> PyResult<Option<Vec<MaskValue>>> {
    let value = |(i, x)| match x {
        0 => Ok(MaskValue::Inpaint),
        1 => Ok(MaskValue::Automatic),
        2 => Ok(MaskValue::ForceMatch),
        _ => Err(InvalidParameter::new_err(format!("mask is {x} at vertex {i}, but must be 0, 1 or 2"))),
    };
    mask.map(|mask| entries(&mask).into_iter().enumerate().map(value).collect()).transpose()
}
