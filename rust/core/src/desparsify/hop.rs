//! Candidates by distance in the bone hierarchy.

use crate::error::{Error, Result};
use crate::weights::Weights;

/// Fills each row with the bones of highest score, score(b) = sum over influences i of w_i 0.5^hops(i, b).
pub(super) fn fill(kept: &Weights, n: usize, parents: &[i32], locked: &[bool]) -> Result<Weights> {
    let proximity = proximities(parents)?;
    let count = parents.len();
    let open: Vec<f64> = locked.iter().map(|&locked| if locked { NEVER } else { 0.0 }).collect();
    let row = |score: &mut Vec<f64>, i: usize, out: &mut Vec<(u32, f32)>| {
        let (bones, values) = kept.row(i);
        score.copy_from_slice(&open);
        for (&bone, &weight) in bones.iter().zip(values) {
            let near = &proximity[bone as usize * count..][..count];
            score.iter_mut().zip(near).for_each(|(s, p)| *s += f64::from(weight) * p);
        }
        bones.iter().for_each(|&bone| score[bone as usize] = NEVER);
        out.extend(bones.iter().copied().zip(values.iter().copied()));
        out.extend(best(score, n.saturating_sub(bones.len())).into_iter().map(|bone| (bone, 0.0)));
        out.sort_unstable_by_key(|&(bone, _)| bone);
    };
    Ok(Weights::from_rows(kept.vertex_count(), kept.n_bones(), || vec![0.0; count], row))
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
