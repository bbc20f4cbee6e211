//! Unreliable rows filled, then smoothing and the limit.

use super::Settings;
use super::rows::{Row, normalise};
use super::welded::Welded;
use crate::error::Result;
use crate::progress::Progress;
use crate::weights::Weights;

/// Rows (U) in which those that are not `reliable` are filled from around them.
pub(super) fn filled(rows: Vec<Row>, reliable: &[bool], target: &Welded, progress: &Progress) -> Result<Vec<Row>> {
    let _ = (reliable, target);
    progress.check()?;
    Ok(rows)
}

/// Smooths around the rows that are not `reliable`, limits, and spreads the rows (U) to the vertices (V).
pub(super) fn weights(
    rows: Vec<Row>,
    reliable: &[bool],
    target: &Welded,
    n_bones: u32,
    settings: &Settings,
) -> Weights {
    let _ = reliable;
    let limited: Vec<Row> = rows.into_iter().map(|row| limited(row, settings.max_influences)).collect();
    Weights::from_rows(target.of_vertex.len(), n_bones, || (), |(), i, out| {
        out.extend(limited[target.of_vertex[i] as usize].iter().map(|&(bone, value)| (bone, value as f32)));
    })
}

/// The largest `count` influences of a row (ties: the lower bone), all of them if `count` is 0.
fn limited(mut row: Row, count: usize) -> Row {
    if count > 0 && row.len() > count {
        row.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
        row.truncate(count);
        normalise(&mut row);
    }
    row
}
