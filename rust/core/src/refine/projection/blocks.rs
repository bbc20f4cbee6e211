//! Particles halved again and again: what lies within one half can be projected while another thread does the other.

/// Particles of a block that is not halved.
const SMALLEST: usize = 2048;
/// Most blocks: each halving leaves constraints between the halves, which wait for both.
const MOST: usize = 32;

/// The particles from `start` on, in blocks of consecutive numbers; blocks do not depend on the number of threads.
///
/// Neighbours should have numbers near each other, as along a Morton curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Blocks {
    start: usize,
    count: usize,
    /// A power of two.
    leaves: usize,
}

impl Blocks {
    /// Of `count` particles.
    pub fn new(start: usize, count: usize) -> Self {
        let leaves = (count / SMALLEST).clamp(1, MOST);
        Self { start, count, leaves: 1 << leaves.ilog2() }
    }

    pub(super) fn leaves(self) -> usize {
        self.leaves
    }

    /// Where leaf `leaf` begins.
    pub(super) fn cut(self, leaf: usize) -> usize {
        self.start + (leaf * self.count).div_ceil(self.leaves)
    }

    /// The smallest block that holds all these particles: 1 is the whole, the halves of n are 2 n and 2 n + 1.
    pub(super) fn owner<const N: usize>(self, particles: [u32; N]) -> usize {
        let leaf = |p: u32| (p as usize - self.start) * self.leaves / self.count + self.leaves;
        let low = particles.iter().fold(u32::MAX, |low, &p| low.min(p));
        let high = particles.iter().fold(0, |high, &p| high.max(p));
        let (low, high) = (leaf(low), leaf(high));
        low >> (usize::BITS - (low ^ high).leading_zeros())
    }

    /// The place of each block (0 for none) in an order that has a block after both of its halves.
    pub(super) fn ranks(self) -> Vec<usize> {
        let mut ranks = vec![0; 2 * self.leaves];
        let mut next = 0;
        self.visit(1, &mut |block| {
            ranks[block] = next;
            next += 1;
        });
        ranks
    }

    /// Calls `visit` with a block and all in it, halves first.
    pub(super) fn visit(self, block: usize, visit: &mut dyn FnMut(usize)) {
        if block < self.leaves {
            self.visit(2 * block, visit);
            self.visit(2 * block + 1, visit);
        }
        visit(block);
    }
}
