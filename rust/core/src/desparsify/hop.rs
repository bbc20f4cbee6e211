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
    let candidates: Vec<u32> = (0..count as u32).filter(|&bone| !is_locked(bone)).collect();
    let fill_row = |score: &mut Vec<f64>, mut row: Row| {
        score.fill(0.0);
        for &(bone, weight) in &row {
            let near = &proximity[bone as usize * count..][..count];
            score.iter_mut().zip(near).for_each(|(s, p)| *s += weight * p);
        }
        let own = row.len();
        let mut best: Vec<u32> = Vec::with_capacity(n);
        for &bone in candidates.iter().filter(|&&bone| row.iter().all(|r| r.0 != bone)) {
            insert_best(&mut best, bone, n.saturating_sub(own), |a, b| score[a as usize] > score[b as usize]);
        }
        row.extend(best.iter().map(|&bone| (bone, 0.0)));
        row.sort_by_key(|&(bone, _)| bone);
        row
    };
    Ok(kept.into_par_iter().with_min_len(256).map_init(|| vec![0.0; count], fill_row).collect())
}

/// Keeps the `limit` best of the items seen so far, best first; of equals the one seen first.
fn insert_best(best: &mut Vec<u32>, item: u32, limit: usize, better: impl Fn(u32, u32) -> bool) {
    let at = best.iter().rposition(|&other| !better(item, other)).map_or(0, |i| i + 1);
    if at < limit {
        best.truncate(limit - 1);
        best.insert(at, item);
    }
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
