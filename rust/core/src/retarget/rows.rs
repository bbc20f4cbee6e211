//! Rows of weights over the target's bones.

use glam::DVec3;

use super::shares::Shares;
use crate::weights::Weights;

pub(super) use crate::fill::Row;

/// The blend of some source vertices' normalised rows, in terms of the target's bones at `position`. Vertices without weight
/// count for nothing; empty if all are.
pub(super) fn blended(
    vertices: impl Iterator<Item = (u32, f64)>,
    weights: &Weights,
    shares: &Shares<'_>,
    position: DVec3,
) -> Row {
    let mut row = Row::new();
    for (i, share) in vertices.filter(|&(_, share)| share > 0.0) {
        let (bones, values) = weights.row(i as usize);
        let sum: f64 = values.iter().map(|&x| f64::from(x)).sum();
        for (&bone, &value) in std::iter::zip(bones, values).filter(|(_, value)| **value > 0.0) {
            shares.push(bone, share * f64::from(value) / sum, position, &mut row);
        }
    }
    normalise(&mut row);
    row
}

/// Sorts by bone, adds up equal bones, drops what is not positive and divides by the sum.
pub(super) fn normalise(row: &mut Row) {
    row.sort_by_key(|&(bone, _)| bone);
    row.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    row.retain(|&(_, value)| value > 0.0);
    let sum: f64 = row.iter().map(|&(_, value)| value).sum();
    row.iter_mut().for_each(|(_, value)| *value /= sum);
}
