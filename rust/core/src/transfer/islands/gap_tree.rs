//! Which island is next: a tree over islands that looks at a gap only when it may be the smallest.
//!
//! A binary tree along a space-filling curve. An island that has been hung is offered to the root and waits at a node as long
//! as something elsewhere is nearer; on the way down it is dropped where another one is certainly nearer. So a chain of
//! a thousand beads that leads to a thousand sequins compares neighbours, not every bead with every sequin.

use super::bounds::Bounds;
use crate::surface::morton_order;

/// Boxes are compared in f32: what they say holds within this share.
const ROUNDING: f64 = 1e-6;

/// Bits of a gap and number of an island, which order as the gaps do, of equal ones the lower island first.
type Key = (u64, u32);

/// The key and the gap of an island that is hung.
const HUNG: (Key, f64) = ((u64::MAX, u32::MAX), f64::NEG_INFINITY);

pub(super) struct GapTree {
    leaves: usize,
    /// Leaf of each island.
    leaf: Vec<u32>,
    /// Island of each leaf.
    island: Vec<u32>,
    boxes: Vec<Bounds>,
    /// At each node, no gap below is smaller than this.
    least: Vec<Key>,
    /// At each node, no gap below is larger than this.
    most: Vec<f64>,
    /// Hung islands that wait at a node, and how near they may be to what is below.
    waiting: Vec<Vec<(f64, u32)>>,
}

impl GapTree {
    /// The tree over islands with these boxes and gaps.
    pub(super) fn new(boxes: &[Bounds], gaps: &[f64]) -> Self {
        let centres: Vec<[f32; 3]> = boxes.iter().map(Bounds::centre).collect();
        let leaves = boxes.len().next_power_of_two();
        let mut tree = Self {
            leaves,
            leaf: vec![0; boxes.len()],
            island: morton_order(&centres),
            boxes: vec![Bounds::NOTHING; 2 * leaves],
            least: vec![HUNG.0; 2 * leaves],
            most: vec![HUNG.1; 2 * leaves],
            waiting: vec![Vec::new(); leaves],
        };
        for (place, &k) in tree.island.iter().enumerate() {
            let node = leaves + place;
            tree.leaf[k as usize] = node as u32;
            tree.boxes[node] = boxes[k as usize];
            (tree.least[node], tree.most[node]) = ((gaps[k as usize].to_bits(), k), gaps[k as usize]);
        }
        for node in (1..leaves).rev() {
            tree.boxes[node] = tree.boxes[2 * node].and(&tree.boxes[2 * node + 1]);
            tree.sum_up(node);
        }
        tree
    }

    pub(super) fn bounds(&self, island: u32) -> &Bounds {
        &self.boxes[self.leaf[island as usize] as usize]
    }

    /// Takes the island with the smallest gap out; `None` if all are hung. `gap(q, p)` is the gap of island q to the hung
    /// island p if it improves on the one that q has.
    pub(super) fn pop(&mut self, gap: &mut impl FnMut(u32, u32) -> Option<f64>) -> Option<u32> {
        loop {
            let mut node = 1;
            while node < self.leaves {
                self.hand_down(node, gap);
                node = if self.least[2 * node] <= self.least[2 * node + 1] { 2 * node } else { 2 * node + 1 };
            }
            let key = self.least[node];
            self.sum_up_from(node);
            if self.least[1] == key {
                if key == HUNG.0 {
                    return None;
                }
                (self.least[node], self.most[node]) = HUNG;
                self.sum_up_from(node);
                return Some(key.1);
            }
        }
    }

    /// Lets the islands that wait know that `island` is hung.
    pub(super) fn offer(&mut self, island: u32, gap: &mut impl FnMut(u32, u32) -> Option<f64>) {
        self.offer_below(1, island, gap);
    }

    fn offer_below(&mut self, node: usize, p: u32, gap: &mut impl FnMut(u32, u32) -> Option<f64>) {
        let (around, bounds) = (&self.boxes[node], *self.bounds(p));
        let nearest = around.distance(&bounds) * (1.0 - ROUNDING);
        if nearest > self.most[node] {
            return;
        }
        if node < self.leaves {
            self.most[node] = self.most[node].min(around.farthest(&bounds) * (1.0 + ROUNDING));
            self.least[node] = self.least[node].min((nearest.to_bits(), 0));
            self.waiting[node].push((nearest, p));
        } else {
            let q = self.island[node - self.leaves];
            if let Some(gap) = gap(q, p) {
                (self.least[node], self.most[node]) = ((gap.to_bits(), q), gap);
            }
        }
    }

    /// Offers what waits at a node to its children, the nearest first.
    fn hand_down(&mut self, node: usize, gap: &mut impl FnMut(u32, u32) -> Option<f64>) {
        let mut waiting = std::mem::take(&mut self.waiting[node]);
        waiting.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, p) in waiting.drain(..) {
            self.offer_below(2 * node, p, gap);
            self.offer_below(2 * node + 1, p, gap);
        }
        self.waiting[node] = waiting;
        self.sum_up(node);
    }

    /// What the children of a node say; nothing waits there.
    fn sum_up(&mut self, node: usize) {
        self.least[node] = self.least[2 * node].min(self.least[2 * node + 1]);
        self.most[node] = self.most[2 * node].max(self.most[2 * node + 1]);
    }

    fn sum_up_from(&mut self, mut node: usize) {
        while node > 1 {
            node /= 2;
            self.sum_up(node);
        }
    }
}
