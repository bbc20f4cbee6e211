//! Rows that are mostly zero, and substitution that touches nothing else.
//!
//! The unknowns of a front lie close together, so they share a list of columns: those that are not zero there. A solution
//! that dies away within some distance of its data then costs what it is long, in memory and in time, however many columns
//! there are elsewhere.

use std::sync::atomic::{AtomicBool, Ordering};

use pulp::Arch;
use rayon::prelude::*;

use crate::fronts::blocks::BLOCK;
use crate::fronts::buffer::Buffer;
use crate::fronts::tree::Tree;
use crate::substitute::backward::Arithmetic;
use crate::substitute::forward::{Active, Given, MOST_COLUMNS, activity, forward};
use crate::substitute::solution::RightHandSides;

/// Subtrees with more columns than this are divided between threads.
const FORK_COLUMNS: usize = 1000;

/// Rows (n, 64 columns at most) of the unknowns of one factorisation, which are mostly zero.
#[derive(Debug)]
pub struct SparseRows<'f> {
    /// Where the factorisation has its fronts; without, everything is one front in the unknowns' order.
    tree: Option<&'f Tree>,
    fronts: Vec<FrontRows>,
}

/// The rows of one front.
#[derive(Debug, Default, Clone)]
pub(crate) struct FrontRows {
    /// Which columns are stored, a bit each.
    mask: u64,
    /// Number of unknowns.
    count: usize,
    /// (unknowns, columns padded to whole vectors)
    values: Vec<f64>,
}

impl FrontRows {
    fn zeroed(mask: u64, count: usize) -> Self {
        Self { mask, count, values: vec![0.0; count * Active::of(mask).width] }
    }

    fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(Active::of(self.mask).width.max(1))
    }

    /// Adds these rows times their factors to others, which have their columns too.
    fn add_to(&self, active: Active, target: &mut [f64], factor: impl Fn(usize) -> f64) {
        let slots = active.slots(&Active::of(self.mask));
        for (k, (row, target)) in self.rows().zip(target.chunks_exact_mut(active.width.max(1))).enumerate() {
            let factor = factor(k);
            if self.mask == active.mask {
                target.iter_mut().zip(row).for_each(|(target, value)| *target += factor * value);
            } else {
                slots.iter().zip(row).for_each(|(&slot, value)| target[slot] += factor * value);
            }
        }
    }

    /// Drops the columns whose magnitude is nowhere more than `least` of its unknown.
    fn prune(self, least: impl Fn(usize) -> f64) -> Self {
        let active = Active::of(self.mask);
        let mut seen = [false; MOST_COLUMNS];
        for (k, row) in self.rows().enumerate() {
            let least = least(k);
            for (seen, row) in seen.as_chunks_mut::<BLOCK>().0.iter_mut().zip(row.as_chunks::<BLOCK>().0) {
                seen.iter_mut().zip(row).for_each(|(seen, value)| *seen |= value.abs() > least);
            }
        }
        let kept = active.columns().zip(seen).filter(|&(_, seen)| seen);
        let mask = kept.fold(0, |mask, (column, _)| mask | 1 << column);
        if mask == self.mask {
            return self;
        }
        let (mut pruned, slots) = (Self::zeroed(mask, self.count), active.slots(&Active::of(mask)));
        let width = Active::of(mask).width.max(1);
        for (target, row) in pruned.values.chunks_exact_mut(width).zip(self.rows()) {
            target.iter_mut().zip(&*slots).for_each(|(target, &slot)| *target = row[slot]);
        }
        pruned
    }
}

/// Where the fronts of a factorisation are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout<'f> {
    pub(crate) tree: Option<&'f Tree>,
    pub(crate) unknowns: usize,
}

impl<'f> Layout<'f> {
    fn front_count(&self) -> usize {
        self.tree.map_or(1, |tree| tree.fronts.len())
    }

    /// Places of a front's unknowns.
    fn places(&self, front: usize) -> std::ops::Range<usize> {
        match self.tree {
            None => 0..self.unknowns,
            Some(tree) => tree.fronts[front].start..tree.fronts[front].start + tree.fronts[front].columns,
        }
    }

    fn unknown(&self, place: usize) -> usize {
        self.tree.map_or(place, |tree| tree.order[place] as usize)
    }

    /// Rows made of what `append` adds to the list for each unknown: columns and values, those of equal columns to be summed.
    pub(crate) fn collect(self, append: impl Fn(usize, &mut Vec<(u32, f64)>) + Sync) -> SparseRows<'f> {
        let rows = |(entries, ends): &mut (Vec<(u32, f64)>, Vec<usize>), front: usize| {
            let places = self.places(front);
            entries.clear();
            ends.clear();
            for place in places.clone() {
                append(self.unknown(place), entries);
                ends.push(entries.len());
            }
            let mask = entries.iter().fold(0, |mask, &(column, _)| mask | 1 << column);
            let (mut rows, active) = (FrontRows::zeroed(mask, places.len()), Active::of(mask));
            let mut start = 0;
            for (row, end) in rows.values.chunks_exact_mut(active.width.max(1)).zip(ends.iter()) {
                entries[start..*end].iter().for_each(|&(column, value)| row[active.slot(column as usize)] += value);
                start = *end;
            }
            rows
        };
        let fronts = (0..self.front_count()).into_par_iter().with_min_len(16);
        SparseRows { tree: self.tree, fronts: fronts.map_init(Default::default, rows).collect() }
    }

    /// The sum of `terms`, each with a factor for every unknown.
    pub(crate) fn sum(self, terms: &[Term<'_, 'f>]) -> SparseRows<'f> {
        let rows = |front: usize| {
            let places = self.places(front);
            let mask = terms.iter().fold(0, |mask, (rows, _)| mask | rows.fronts[front].mask);
            let mut sum = FrontRows::zeroed(mask, places.len());
            for (rows, factor) in terms {
                let factor = |k: usize| factor(self.unknown(places.start + k));
                rows.fronts[front].add_to(Active::of(mask), &mut sum.values, factor);
            }
            sum
        };
        let fronts = (0..self.front_count()).into_par_iter().with_min_len(4).map(rows).collect();
        SparseRows { tree: self.tree, fronts }
    }

    /// The rows of a solution whose first columns are `row` of each unknown.
    pub(crate) fn only_front<'r, I: Iterator<Item = f64> + 'r>(
        self,
        row: impl Fn(usize) -> I + Sync,
        least: impl Fn(usize) -> f64,
        columns: usize,
    ) -> SparseRows<'f> {
        let mask = if columns == MOST_COLUMNS { u64::MAX } else { (1 << columns) - 1 };
        let (mut rows, width) = (FrontRows::zeroed(mask, self.unknowns), Active::of(mask).width);
        for (k, target) in rows.values.chunks_exact_mut(width.max(1)).enumerate() {
            target.iter_mut().zip(row(k)).for_each(|(target, value)| *target = value);
        }
        SparseRows { tree: None, fronts: vec![rows.prune(least)] }
    }
}

/// Rows and a factor for each unknown.
pub type Term<'a, 'f> = (&'a SparseRows<'f>, &'a (dyn Fn(usize) -> f64 + Sync));

impl SparseRows<'_> {
    /// All values that are stored, and some zeros.
    pub fn values(&self) -> impl Iterator<Item = f64> + '_ {
        self.fronts.iter().flat_map(|rows| &rows.values).copied()
    }

    /// Columns and values of one unknown, by column, without those that are not stored.
    pub fn row(&self, unknown: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let (front, row) = match self.tree {
            None => (0, unknown),
            Some(tree) => {
                let place = tree.place[unknown] as usize;
                let front = tree.fronts.partition_point(|front| front.start + front.columns <= place);
                (front, place - tree.fronts[front].start)
            }
        };
        let FrontRows { mask, values, .. } = &self.fronts[front];
        let active = Active::of(*mask);
        active.columns().map(|column| column as u32).zip(values[row * active.width..].iter().copied())
    }

    /// The same with zeros, in the order of the columns, of `n` unknowns.
    pub(crate) fn to_dense(&self, n: usize) -> RightHandSides {
        let columns = self.fronts.iter().map(|rows| 64 - rows.mask.leading_zeros()).max().unwrap_or(0) as usize;
        let mut values = vec![0.0; n * columns];
        for (k, target) in values.chunks_exact_mut(columns.max(1)).enumerate() {
            self.row(k).for_each(|(column, value)| target[column as usize] = value);
        }
        RightHandSides::dense(n, columns, values)
    }
}

impl Given for SparseRows<'_> {
    fn mask(&self, front: usize) -> u64 {
        self.fronts[front].mask
    }

    fn put(&self, front: usize, active: Active, y: &mut [f64]) {
        self.fronts[front].add_to(active, y, |_| 1.0);
    }
}

/// Solves for `given` where the solution matters: `least` is the magnitude up to which it counts as zero at each place (n).
/// Once `stop` is set the answer means nothing.
pub(crate) fn solve<'f>(
    (tree, panels, arch): (&'f Tree, &[f64], Arch),
    given: &SparseRows<'f>,
    least: &[f64],
    stop: &AtomicBool,
) -> SparseRows<'f> {
    let active = activity(tree, given, None);
    let length = tree.fronts.iter().zip(&active).map(|(front, active)| front.columns * active.width).sum();
    let mut halfway = Buffer::zeroed(length);
    forward(tree, panels, arch, given, &active, None, &mut halfway);
    let (mut panel_starts, mut starts, mut subtree_least) = (Vec::new(), Vec::new(), Vec::<f64>::new());
    let (mut panel_start, mut start) = (0, 0);
    for (front, active) in tree.fronts.iter().zip(&active) {
        panel_starts.push(panel_start);
        starts.push(start);
        panel_start += front.panel_len();
        start += front.columns * active.width;
        let own = least[front.start..front.start + front.columns].iter().copied();
        let below = front.children.iter().map(|&child| subtree_least[child]);
        subtree_least.push(own.chain(below).fold(f64::INFINITY, f64::min));
    }
    let mut fronts = vec![FrontRows::default(); tree.fronts.len()];
    let (root, halfway) = (tree.root(), &halfway[..]);
    let pass = Backward { tree, panels, panel_starts, arch, active, starts, halfway, least, subtree_least, stop };
    pass.descend(root, pass.active[root], &[], &mut fronts, 0);
    SparseRows { tree: Some(tree), fronts }
}

/// Backward substitution. Each front is solved for the columns of the data in its subtree, and for those in which the
/// solution around is not negligible.
struct Backward<'a> {
    tree: &'a Tree,
    panels: &'a [f64],
    panel_starts: Vec<usize>,
    arch: Arch,
    /// What forward substitution has left: columns of each front, where its rows start, and all of them.
    active: Vec<Active>,
    starts: Vec<usize>,
    halfway: &'a [f64],
    /// Magnitude that counts as zero, by place.
    least: &'a [f64],
    /// The smallest of them in each front's subtree.
    subtree_least: Vec<f64>,
    stop: &'a AtomicBool,
}

/// A front whose solution is known.
struct Solved<'a> {
    index: usize,
    active: Active,
    own: &'a [f64],
    boundary: &'a [f64],
}

impl Backward<'_> {
    /// Solves the subtree of `index`, `fronts` being its own and `first` the index of the first of them, given the solution
    /// in the rows under the front, both for `active` columns.
    fn descend(&self, index: usize, active: Active, boundary: &[f64], fronts: &mut [FrontRows], first: usize) {
        let front = &self.tree.fronts[index];
        let (this, below) = fronts[..=index - first].split_last_mut().expect("the front is there");
        this.count = front.columns;
        if active.mask == 0 || self.stop.load(Ordering::Relaxed) {
            below.iter_mut().zip(first..).for_each(|(rows, index)| rows.count = self.tree.fronts[index].columns);
            return;
        }
        let width = active.width;
        let mut own = vec![0.0; front.columns * width];
        let done = self.active[index];
        let slots = active.slots(&done);
        let halfway = self.halfway[self.starts[index]..].chunks(done.width.max(1));
        for (row, halfway) in own.chunks_exact_mut(width).zip(halfway) {
            slots.iter().zip(halfway).for_each(|(&slot, &value)| row[slot] = value);
        }
        let panel = &self.panels[self.panel_starts[index]..][..front.panel_len()];
        Arithmetic { arch: self.arch, width }.solve_front(front, panel, &mut own, boundary);
        self.children(&front.children, &Solved { index, active, own: &own, boundary }, below, first);
        let rows = FrontRows { mask: active.mask, count: front.columns, values: own };
        *this = rows.prune(|k| self.least[front.start + k]);
    }

    fn children(&self, roots: &[usize], parent: &Solved, fronts: &mut [FrontRows], first: usize) {
        match roots {
            [] => {}
            &[root] => {
                let active = Active::of(self.active[root].mask | self.noticeable(root, parent));
                let boundary = self.boundary(root, active, parent);
                self.descend(root, active, &boundary, fronts, first);
            }
            _ => {
                let (left, right) = roots.split_at(roots.len() / 2);
                let cut = left[left.len() - 1] + 1;
                let (before, after) = fronts.split_at_mut(cut - first);
                let columns =
                    |roots: &[usize]| roots.iter().map(|&root| self.tree.fronts[root].subtree_columns).sum::<usize>();
                if columns(left).min(columns(right)) > FORK_COLUMNS {
                    rayon::join(
                        || self.children(left, parent, before, first),
                        || self.children(right, parent, after, cut),
                    );
                } else {
                    self.children(left, parent, before, first);
                    self.children(right, parent, after, cut);
                }
            }
        }
    }

    /// The rows of the parent's solution under the columns of `child`.
    fn rows_under<'a>(&'a self, child: usize, parent: &'a Solved) -> impl Iterator<Item = &'a [f64]> {
        let (columns, width) = (self.tree.fronts[parent.index].columns, parent.active.width);
        self.tree.fronts[child].in_parent.iter().map(move |&place| match (place as usize).checked_sub(columns) {
            None => &parent.own[place as usize * width..][..width],
            Some(row) => &parent.boundary[row * width..][..width],
        })
    }

    /// The columns in which the solution around the subtree of `child` is not negligible.
    fn noticeable(&self, child: usize, parent: &Solved) -> u64 {
        let least = self.subtree_least[child];
        let mut seen = [false; MOST_COLUMNS];
        for row in self.rows_under(child, parent) {
            for (seen, row) in seen.as_chunks_mut::<BLOCK>().0.iter_mut().zip(row.as_chunks::<BLOCK>().0) {
                seen.iter_mut().zip(row).for_each(|(seen, value)| *seen |= value.abs() > least);
            }
        }
        let columns = parent.active.columns().zip(seen).filter(|&(_, seen)| seen);
        columns.fold(0, |mask, (column, _)| mask | 1 << column)
    }

    /// The solution in the rows under the columns of `child`, (rows padded to whole blocks, width).
    fn boundary(&self, child: usize, active: Active, parent: &Solved) -> Vec<f64> {
        let count = self.tree.fronts[child].rows.len().next_multiple_of(BLOCK);
        let mut boundary = vec![0.0; count * active.width];
        if active.mask == 0 {
            return boundary;
        }
        let slots = parent.active.slots(&active);
        for (target, row) in boundary.chunks_exact_mut(active.width).zip(self.rows_under(child, parent)) {
            if active.mask == parent.active.mask {
                target.copy_from_slice(row);
            } else {
                target.iter_mut().zip(&*slots).for_each(|(target, &slot)| *target = row[slot]);
            }
        }
        boundary
    }
}
