//! Particles, and constraints of one kind over them, as arrays for the kernels.

use super::blocks::Blocks;
use super::colouring::{Colouring, NONE};

/// Place and inverse mass of a particle: x, y, z, w.
pub type Particle = [f32; 4];

/// Colours with the one for constraints that have none.
const COLOURS: usize = 129;

/// Constraints of one kind in projection order, each over `N` particles with `M` numbers at rest.
#[derive(Debug, Clone)]
pub struct Batch<const N: usize, const M: usize> {
    /// Particles, an array per corner.
    pub particles: [Vec<u32>; N],
    /// What each constraint keeps.
    pub rest: [Vec<f32>; M],
    pub(super) blocks: Blocks,
    /// Of every block: the constraints that lie in it and in none of its halves.
    pub(super) spans: Vec<Span>,
    /// Ends of the runs of constraints that share no particle.
    pub(super) ends: Vec<u32>,
}

/// Constraints `from..to`, whose runs end at `ends[runs.0..runs.1]`.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Span {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) runs: (usize, usize),
}

impl<const N: usize, const M: usize> Batch<N, M> {
    /// Of the constraints that `kept` names, block by block, colour by colour.
    ///
    /// Their particles must lie in `blocks`.
    pub fn new(
        blocks: Blocks,
        colouring: &Colouring,
        kept: &[u32],
        particles: impl Fn(u32) -> [u32; N],
        rest: impl Fn(u32) -> [f32; M],
    ) -> Self {
        let ranks = blocks.ranks();
        let corners: Vec<[u32; N]> = kept.iter().map(|&k| particles(k)).collect();
        let key = |(corners, &k): (&[u32; N], &u32)| {
            ranks[blocks.owner(*corners)] * COLOURS + usize::from(colouring.0[k as usize]).min(COLOURS - 1)
        };
        let keys: Vec<u32> = corners.iter().zip(kept).map(|pair| key(pair) as u32).collect();
        let (starts, order) = sorted(&keys, ranks.len() * COLOURS);
        let column = |n: usize| order.iter().map(|&k| corners[k as usize][n]).collect();
        let mut batch = Self {
            particles: std::array::from_fn(column),
            rest: std::array::from_fn(|_| Vec::with_capacity(kept.len())),
            blocks,
            spans: vec![Span::default(); ranks.len()],
            ends: Vec::new(),
        };
        for &k in order.iter().filter(|_| M > 0) {
            rest(kept[k as usize]).into_iter().zip(&mut batch.rest).for_each(|(x, column)| column.push(x));
        }
        blocks.visit(1, &mut |block| batch.spans[block] = add_runs(&mut batch.ends, &starts, ranks[block] * COLOURS));
        batch
    }

    /// Those at the positions `kept` (ascending) alone.
    pub(super) fn subset(&self, kept: &[u32]) -> Self {
        let below = |position: usize| kept.partition_point(|&k| (k as usize) < position);
        let column = |values: &Vec<u32>| kept.iter().map(|&k| values[k as usize]).collect();
        let mut spans = self.spans.clone();
        let mut ends = Vec::new();
        self.blocks.visit(1, &mut |block| {
            let span = self.spans[block];
            let (from, first) = (below(span.from), ends.len());
            let mut before = from as u32;
            for &end in &self.ends[span.runs.0..span.runs.1] {
                let end = below(end as usize) as u32;
                ends.extend((end > before).then_some(end));
                before = end;
            }
            spans[block] = Span { from, to: before as usize, runs: (first, ends.len()) };
        });
        Self {
            particles: self.particles.each_ref().map(column),
            rest: self.rest.each_ref().map(|values| kept.iter().map(|&k| values[k as usize]).collect()),
            blocks: self.blocks,
            spans,
            ends,
        }
    }

    /// Number of constraints.
    pub fn len(&self) -> usize {
        self.particles[0].len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where the constraints in `block` and in its halves begin.
    pub(super) fn first_of(&self, mut block: usize) -> usize {
        while block < self.blocks.leaves() {
            block *= 2;
        }
        self.spans[block].from
    }
}

/// Where each key begins, and the positions sorted by key.
fn sorted(keys: &[u32], count: usize) -> (Vec<usize>, Vec<u32>) {
    let mut starts = vec![0; count + 1];
    keys.iter().for_each(|&key| starts[key as usize + 1] += 1);
    (0..count).for_each(|key| starts[key + 1] += starts[key]);
    let (mut next, mut order) = (starts.clone(), vec![0; keys.len()]);
    for (k, &key) in keys.iter().enumerate() {
        order[next[key as usize]] = k as u32;
        next[key as usize] += 1;
    }
    (starts, order)
}

/// The runs of a block's colours, whose keys begin at `first`; constraints without a colour are a run each.
fn add_runs(ends: &mut Vec<u32>, starts: &[usize], first: usize) -> Span {
    let before = ends.len();
    for key in first..first + COLOURS {
        let (from, to) = (starts[key], starts[key + 1]);
        if key - first == COLOURS - 1 {
            ends.extend((from..to).map(|k| k as u32 + 1));
        } else if to > from {
            ends.push(to as u32);
        }
    }
    Span { from: starts[first], to: starts[first + COLOURS], runs: (before, ends.len()) }
}

/// The multipliers of a batch, `L` per constraint.
#[derive(Debug, Clone)]
pub struct Multipliers<const L: usize>(pub(super) [Vec<f32>; L]);

impl<const L: usize> Multipliers<L> {
    /// Zeros.
    pub fn new(constraints: usize) -> Self {
        Self(std::array::from_fn(|_| vec![0.0; constraints]))
    }

    /// Forgets them: the next projection starts from where the particles then are.
    pub fn restart(&mut self) {
        self.0.iter_mut().for_each(|column| column.fill(0.0));
    }
}

const _: () = assert!(NONE as usize >= COLOURS - 1);
