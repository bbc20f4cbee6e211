//! The source's bones in terms of the target's: partners, several partners, none.

use glam::DVec3;

use super::skeleton::{BonePair, Skeleton};

/// Power of the distance by which several partners share.
const POWER: i32 = 4;

/// For each bone of the source the bones of the target that take its share.
#[derive(Debug)]
pub struct Shares<'a> {
    target: &'a Skeleton,
    heirs: Vec<Vec<u32>>,
    /// Bones of the source without a partner that hold weight, and the bone of the source whose partners take it.
    pub inherited: Vec<(u32, u32)>,
}

impl<'a> Shares<'a> {
    /// `pairs` as checked; `parents` (the source's bones, negative for a root) lead from a bone without a partner to its nearest
    /// mapped ancestor. Without one, or without parents, the nearest mapped bone inherits. `weighted` (the source's bones).
    pub fn new(
        pairs: &[BonePair],
        source: &Skeleton,
        target: &'a Skeleton,
        parents: Option<&[i32]>,
        weighted: &[bool],
    ) -> Self {
        let mut partners = vec![Vec::new(); source.bones().len()];
        for pair in pairs {
            partners[pair.source as usize].push(pair.target);
        }
        let (mut heirs, mut inherited) = (partners.clone(), Vec::new());
        for bone in (0..partners.len()).filter(|&bone| partners[bone].is_empty()) {
            let heir = parents.and_then(|parents| mapped_ancestor(bone, parents, &partners));
            let heir = heir.unwrap_or_else(|| nearest_mapped(bone, source, &partners));
            heirs[bone].clone_from(&partners[heir]);
            if weighted[bone] {
                inherited.push((bone as u32, heir as u32));
            }
        }
        Self { target, heirs, inherited }
    }

    /// Appends the target's bones that take `weight` of the source's bone at `position` on the target.
    pub fn push(&self, bone: u32, weight: f64, position: DVec3, row: &mut Vec<(u32, f64)>) {
        let heirs = &self.heirs[bone as usize];
        if let [only] = heirs[..] {
            row.push((only, weight));
            return;
        }
        let distance = |&t: &u32| self.target.bones()[t as usize].distance(position);
        let nearest = heirs.iter().map(distance).fold(f64::INFINITY, f64::min);
        let share =
            |t: &u32| if nearest > 0.0 { (nearest / distance(t)).powi(POWER) } else { f64::from(distance(t) == 0.0) };
        let total: f64 = heirs.iter().map(share).sum();
        row.extend(heirs.iter().map(|t| (*t, weight * share(t) / total)));
    }
}

fn mapped_ancestor(bone: usize, parents: &[i32], partners: &[Vec<u32>]) -> Option<usize> {
    let mut at = bone;
    // A cycle among the parents ends the walk.
    for _ in 0..parents.len() {
        at = usize::try_from(parents[at]).ok().filter(|&p| p < parents.len())?;
        if !partners[at].is_empty() {
            return Some(at);
        }
    }
    None
}

fn nearest_mapped(bone: usize, source: &Skeleton, partners: &[Vec<u32>]) -> usize {
    let head = source.bones()[bone].head;
    let mapped = (0..partners.len()).filter(|&other| !partners[other].is_empty());
    let distance = |&other: &usize| source.bones()[other].distance(head);
    mapped.min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("there is a pair")
}
