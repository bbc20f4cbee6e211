//! Rows as they leave a method.

/// Shares below this part of a row's largest are left out.
const NEGLIGIBLE: f64 = 1e-4;

/// Appends a row to `out`: sorted by bone, without negligible shares, divided by its sum.
pub(super) fn append(mut row: Vec<(u32, f64)>, out: &mut Vec<(u32, f32)>) {
    let largest = row.iter().map(|&(_, value)| value).fold(0.0, f64::max);
    row.retain(|&(_, value)| value > NEGLIGIBLE * largest);
    row.sort_unstable_by_key(|&(bone, _)| bone);
    let sum: f64 = row.iter().map(|&(_, value)| value).sum();
    out.extend(row.into_iter().map(|(bone, value)| (bone, (value / sum) as f32)));
}
