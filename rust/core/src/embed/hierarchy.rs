//! What hangs on what: as the armature says, and where it does not.

use glam::DVec3;

use super::Template;

/// A root hangs on the end of a limb if it lies in front of it within this share of the skeleton's size.
const NEAR: f64 = 0.15;

/// Parent of each bone (B), where roots that continue a limb hang on it: the feet of many rigs are bones of their own, which
/// only constraints tie to the leg.
pub(super) fn parents(template: &Template<'_>) -> Vec<Option<usize>> {
    let own: Vec<Option<usize>> = (0..template.len()).map(|j| template.parent(j)).collect();
    let mut is_leaf = vec![true; template.len()];
    own.iter().flatten().for_each(|&parent| is_leaf[parent] = false);
    let reach = NEAR * size(template);
    let mut parents = own.clone();
    for root in (0..template.len()).filter(|&j| own[j].is_none()) {
        let head = template.head(root);
        let gap = |leaf: &usize| head.distance(template.tail(*leaf));
        let continues = |leaf: &usize| {
            let along = template.tail(*leaf) - template.head(*leaf);
            gap(leaf) < reach && along.dot(head - template.tail(*leaf)) >= 0.0 && top(&own, *leaf) != root
        };
        let leaves = (0..template.len()).filter(|&j| is_leaf[j]).filter(continues);
        let nearest = leaves.min_by(|a, b| gap(a).total_cmp(&gap(b)));
        // Two roots must not hang on each other.
        parents[root] = nearest.filter(|&leaf| top(&parents, leaf) != root);
    }
    parents
}

/// The root that `bone` hangs on.
fn top(parents: &[Option<usize>], mut bone: usize) -> usize {
    while let Some(parent) = parents[bone] {
        bone = parent;
    }
    bone
}

/// Diagonal of the box around all heads and tails.
fn size(template: &Template<'_>) -> f64 {
    let ends = (0..template.len()).flat_map(|j| [template.head(j), template.tail(j)]);
    let (low, high) = ends.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    low.distance(high)
}
