//! The template without everything small and everything along the way: branches, extremities, and the limbs between them.

use glam::DVec3;

use super::super::{Template, hierarchy};
use crate::error::{Error, Result};

/// A branch counts if it is at least this share of the longest way down from the root.
const LEAST_BRANCH: f64 = 0.2;

/// Branches whose lengths differ by less than this share of theirs are a pair.
const TWINS: f64 = 1e-3;

/// A branch or an extremity.
#[derive(Debug, Clone)]
pub(in crate::embed) struct Joint {
    /// In the template's space.
    pub(in crate::embed) position: DVec3,
    /// The limb that leads here; none for the first joint, which is the root.
    pub(in crate::embed) limb: Option<Limb>,
    /// The bone whose head this is, or whose tail, at an extremity.
    pub(in crate::embed) bone: usize,
    pub(in crate::embed) is_extremity: bool,
}

/// What leads to a joint.
#[derive(Debug, Clone)]
pub(in crate::embed) struct Limb {
    /// Index of the joint where it starts.
    pub(in crate::embed) from: usize,
    /// Bones whose heads lie between the two joints, in order.
    pub(in crate::embed) bones: Vec<usize>,
    /// Where these heads lie, as shares of the length.
    pub(in crate::embed) shares: Vec<f64>,
    pub(in crate::embed) length: f64,
}

/// Parents come before children.
#[derive(Debug)]
pub(in crate::embed) struct Reduced {
    pub(in crate::embed) joints: Vec<Joint>,
}

/// The hierarchy, and how long the longest way is from the head of each bone to the end of what hangs on it.
struct Tree<'a> {
    template: &'a Template<'a>,
    parents: Vec<Option<usize>>,
    children: Vec<Vec<usize>>,
    longest: Vec<f64>,
}

impl<'a> Tree<'a> {
    fn new(template: &'a Template<'a>) -> Self {
        let parents = hierarchy::parents(template);
        let mut children = vec![Vec::new(); template.len()];
        for (j, parent) in parents.iter().enumerate() {
            if let Some(parent) = *parent {
                children[parent].push(j);
            }
        }
        let mut tree = Self { template, parents, children, longest: vec![0.0; template.len()] };
        let mut order: Vec<usize> = tree.roots().collect();
        let mut k = 0;
        while k < order.len() {
            order.extend(&tree.children[order[k]]);
            k += 1;
        }
        for &j in order.iter().rev() {
            let own = template.head(j).distance(template.tail(j));
            tree.longest[j] = tree.children[j].iter().map(|&c| tree.below(j, c)).fold(own, f64::max);
        }
        tree
    }

    fn roots(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.parents.len()).filter(|&j| self.parents[j].is_none())
    }

    /// Longest way from the head of `j` through its child `c`.
    fn below(&self, j: usize, c: usize) -> f64 {
        self.template.head(j).distance(self.template.head(c)) + self.longest[c]
    }

    fn branches(&self, j: usize, least: f64) -> Vec<usize> {
        self.children[j].iter().copied().filter(|&c| self.longest[c] >= least).collect()
    }

    /// The child that the longest way from `j` goes through, or none if it ends at the tail of `j`. Of a pair that is as long
    /// on both sides, such as ears and eyes, neither continues the limb.
    fn deepest(&self, j: usize) -> Option<usize> {
        let own = self.template.head(j).distance(self.template.tail(j));
        let has_twin = |c: usize| {
            let close = |other: usize| (self.below(j, c) - self.below(j, other)).abs() < TWINS * self.below(j, c);
            self.children[j].iter().any(|&other| other != c && close(other))
        };
        let alone = self.children[j].iter().copied().filter(|&c| self.below(j, c) > own && !has_twin(c));
        alone.max_by(|&a, &b| self.below(j, a).total_cmp(&self.below(j, b)))
    }
}

impl Reduced {
    /// # Errors
    /// [`Error::InvalidSkeleton`] if the template has no extent.
    pub(in crate::embed) fn new(template: &Template<'_>) -> Result<Self> {
        let tree = Tree::new(template);
        let top =
            tree.roots().max_by(|&a, &b| tree.longest[a].total_cmp(&tree.longest[b])).expect("parents end somewhere");
        if tree.longest[top] == 0.0 {
            return Err(Error::InvalidSkeleton { reason: "all of its bones lie in one point".into() });
        }
        let mut root = top;
        let mut least = LEAST_BRANCH * tree.longest[root];
        // Control bones above the first branch are not part of the body, and their length does not count.
        while let [only] = tree.branches(root, least)[..] {
            root = only;
            least = LEAST_BRANCH * tree.longest[root];
        }
        if tree.branches(root, least).is_empty() {
            root = top;
        }
        let joint = Joint { position: template.head(root), limb: None, bone: root, is_extremity: false };
        let mut reduced = Self { joints: vec![joint] };
        let mut k = 0;
        while k < reduced.joints.len() {
            if !reduced.joints[k].is_extremity {
                let mut branches = tree.branches(reduced.joints[k].bone, least);
                if branches.is_empty() {
                    branches.extend(tree.deepest(reduced.joints[k].bone));
                }
                for branch in branches {
                    let joint = follow(&tree, k, &reduced.joints[k], branch, least);
                    reduced.joints.push(joint);
                }
            }
            k += 1;
        }
        if reduced.joints.len() < 2 {
            return Err(Error::InvalidSkeleton { reason: "it is a single bone".into() });
        }
        Ok(reduced)
    }

    /// Longest way from one extremity to another.
    pub(super) fn diameter(&self) -> f64 {
        let (mut deepest, mut widest) = (vec![0.0f64; self.joints.len()], 0.0f64);
        for k in (1..self.joints.len()).rev() {
            let limb = self.joints[k].limb.as_ref().expect("only the root has none");
            let here = deepest[k] + limb.length;
            widest = widest.max(deepest[limb.from] + here);
            deepest[limb.from] = deepest[limb.from].max(here);
        }
        widest
    }
}

/// The joint at the end of the limb that starts at joint `from` with bone `first`.
fn follow(tree: &Tree<'_>, from: usize, start: &Joint, first: usize, least: f64) -> Joint {
    let template = tree.template;
    let (mut bones, mut points) = (vec![first], vec![start.position, template.head(first)]);
    let mut bone = first;
    let is_extremity = loop {
        let branches = tree.branches(bone, least);
        let next = match branches[..] {
            [] => tree.deepest(bone),
            [only] => Some(only),
            _ => break false,
        };
        let Some(next) = next else {
            points.push(template.tail(bone));
            break true;
        };
        bone = next;
        bones.push(bone);
        points.push(template.head(bone));
    };
    if !is_extremity {
        bones.pop();
    }
    let mut along = vec![0.0];
    for pair in points.windows(2) {
        along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
    }
    let length = along[along.len() - 1].max(f64::MIN_POSITIVE);
    let shares = along[1..=bones.len()].iter().map(|x| x / length).collect();
    let position = points[points.len() - 1];
    Joint { position, limb: Some(Limb { from, bones, shares, length }), bone, is_extremity }
}
