//! Candidates by distance in the bone hierarchy.

use rayon::prelude::*;

use super::Row;
use crate::error::{Error, Result};

/// Fills each row with the bones of highest score, score(b) = sum over influences i of w_i 0.5^hops(i, b).
pub(super) fn fill(
    kept: Vec<Row>,
    n: usize,
    parents: &[i32],
    is_locked: impl Fn(u32) -> bool + Sync,
) -> Result<Vec<Row>> {
    let proximity = proximities(parents)?;
    let count = parents.len();
    let closed: Vec<f64> = (0..count as u32).map(|bone| if is_locked(bone) { NEVER } else { 0.0 }).collect();
    let fill_row = |score: &mut Vec<f64>, mut row: Row| {
        score.copy_from_slice(&closed);
        for &(bone, weight) in &row {
            let near = &proximity[bone as usize * count..][..count];
            score.iter_mut().zip(near).for_each(|(s, p)| *s += weight * p);
        }
        row.iter().for_each(|&(bone, _)| score[bone as usize] = NEVER);
        let wanted = n.saturating_sub(row.len());
        row.extend(best(score, wanted).into_iter().map(|bone| (bone, 0.0)));
        row.sort_unstable_by_key(|&(bone, _)| bone);
        row
    };
    Ok(kept.into_par_iter().with_min_len(256).map_init(|| vec![0.0; count], fill_row).collect())
}

/// The score of a bone that may not be given.
const NEVER: f64 = f64::NEG_INFINITY;

/// The bones of highest score, at most `wanted`; of equals the first.
fn best(score: &[f64], wanted: usize) -> Vec<u32> {
    let mut best: Vec<u32> = Vec::with_capacity(wanted + 1);
    let mut least = NEVER;
    for (bone, &s) in (0..).zip(score) {
        if s > least && wanted > 0 {
            let at = best.partition_point(|&other| score[other as usize] >= s);
            best.insert(at, bone);
            best.truncate(wanted);
            if best.len() == wanted {
                least = score[best[wanted - 1] as usize];
            }
        }
    }
    best
}

/// 0.5^hops between all bones, (B, B), zero between bones under different roots.
///
/// Hops follow from those of the parent: hops(b, x) = hops(parent(b), x) + 1 for every x that comes before b.
fn proximities(parents: &[i32]) -> Result<Vec<f64>> {
    let count = parents.len();
    let mut proximity = vec![0.0; count * count];
    let order = parents_first(parents)?;
    for (seen, &b) in order.iter().enumerate() {
        if let Ok(parent) = usize::try_from(parents[b]) {
            for &x in &order[..seen] {
                let half = 0.5 * proximity[parent * count + x];
                proximity[b * count + x] = half;
                proximity[x * count + b] = half;
            }
        }
        proximity[b * count + b] = 1.0;
    }
    Ok(proximity)
}

/// All bones, each after its parent.
fn parents_first(parents: &[i32]) -> Result<Vec<usize>> {
    let invalid = |value: i32, must| Err(Error::InvalidParameter { name: "bone_parents", value: value.into(), must });
    if let Some(&parent) = parents.iter().find(|&&p| p >= parents.len() as i32) {
        return invalid(parent, "a parent must be one of the bones, or -1");
    }
    let mut depth = vec![0usize; parents.len()];
    for bone in 0..parents.len() {
        let mut ancestor = parents[bone];
        while let Ok(parent) = usize::try_from(ancestor) {
            depth[bone] += 1;
            if depth[bone] > parents.len() {
                return invalid(parents[bone], "no bone may be its own ancestor");
            }
            ancestor = parents[parent];
        }
    }
    let mut order: Vec<usize> = (0..parents.len()).collect();
    order.sort_by_key(|&bone| depth[bone]);
    Ok(order)
}
