//! Settings of a transfer from keyword arguments.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use skinwright_core::transfer::{IslandPolicy, Length, MaskValue, MatchMethod, Settings, SmallIslands};

use crate::arrays::{Vector, entries};
use crate::error::{InvalidParameter, to_python};

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
        match name.extract::<&str>()? {
            "max_distance" => max_distance = value.extract()?,
            "relative_max_distance" => settings.max_distance = Length::Relative(value.extract()?),
            "max_normal_angle" => settings.max_normal_angle = value.extract()?,
            "match_flipped_normals" => settings.match_flipped_normals = value.extract()?,
            "relative_weld_tolerance" => settings.weld_tolerance = Length::Relative(value.extract()?),
            "mask" => mask = mask_values(value.extract()?)?,
            "smoothness_length" => smoothness_length = value.extract()?,
            "relative_smoothness_length" => settings.smoothness_length = Length::Relative(value.extract()?),
            "smoothing_iterations" => settings.smoothing_iterations = value.extract()?,
            "smoothing_factor" => settings.smoothing_factor = value.extract()?,
            "max_influences" => settings.max_influences = value.extract()?,
            "method" => settings.method = named("method", value.extract()?, MatchMethod::ALL, method_name)?,
            "softness" => settings.softness = value.extract()?,
            "island_policy" => {
                settings.island_policy = named("island_policy", value.extract()?, IslandPolicy::ALL, policy_name)?;
            }
            "small_islands" => {
                let choice = value.extract()?;
                settings.small_islands = named("small_islands", choice, SmallIslands::ALL, small_islands_name)?;
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

fn mask_values(mask: Option<Vector<'_, u8>>) -> PyResult<Option<Vec<MaskValue>>> {
    let value = |(i, x)| match x {
        0 => Ok(MaskValue::Inpaint),
        1 => Ok(MaskValue::Automatic),
        2 => Ok(MaskValue::ForceMatch),
        _ => Err(InvalidParameter::new_err(format!("mask is {x} at vertex {i}, but must be 0, 1 or 2"))),
    };
    mask.map(|mask| entries(&mask).into_iter().enumerate().map(value).collect()).transpose()
}
