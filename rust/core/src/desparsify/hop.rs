//! Candidates by distance in the bone hierarchy.

use crate::weights::Weights;

/// `order` has parents first. Fills each row with the bones of highest score, score(b) = sum over influences i of w_i 0.5^hops(i, b).
pub(super) fn fill(kept: &Weights, n: usize, parents: &[i32], order: &[usize], locked: &[bool]) -> Weights {
    let proximity = proximities(parents, order);
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
    Weights::from_rows(kept.vertex_count(), kept.n_bones(), || vec![0.0; count], row)
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
fn proximities(parents: &[i32], order: &[usize]) -> Vec<f64> {
    let count = parents.len();
    let mut proximity = vec![0.0; count * count];
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
    proximity
}
