//! Rows that are mostly zero: how they are stored, made and added up.
//!
//! The unknowns of a front lie close together, so they share a list of columns: those that are not zero there.

use rayon::prelude::*;

use crate::fronts::buffer::Buffer;
use crate::fronts::tree::Tree;
use crate::kernels::Real;
use crate::substitute::forward::{Active, Given, MOST_COLUMNS};
use crate::substitute::solution::RightHandSides;

/// Rows (n, 64 columns at most) of the unknowns of one factorisation, which are mostly zero, in single precision.
#[derive(Debug)]
pub struct SparseRows<'f> {
    /// Where the factorisation has its fronts; without, everything is one front in the unknowns' order.
    pub(crate) tree: Option<&'f Tree>,
    pub(crate) fronts: Vec<Place>,
    /// Where the values are: a list for every front would keep the allocator busier than the processor.
    pub(crate) chunks: Vec<Buffer<f32>>,
}

/// Where the rows of one front are.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Place {
    /// Which columns are stored, a bit each.
    mask: u64,
    chunk: u32,
    /// Place in the chunk of its first value, and number of values: (unknowns, columns padded to whole vectors).
    start: usize,
    len: usize,
}

/// The rows of one front.
#[derive(Clone, Copy)]
pub(crate) struct FrontRows<'a> {
    pub(crate) mask: u64,
    pub(crate) values: &'a [f32],
}

impl<'a> FrontRows<'a> {
    fn rows(&self) -> impl Iterator<Item = &'a [f32]> {
        self.values.chunks_exact(active(self.mask).width.max(1))
    }

    /// Adds these rows times their factors to others, which have their columns too.
    fn add_to(&self, all: Active, target: &mut [f32], factor: impl Fn(usize) -> f32) {
        let targets = target.chunks_exact_mut(all.width.max(1));
        if self.mask == all.mask {
            for (k, (row, target)) in self.rows().zip(targets).enumerate() {
                let factor = factor(k);
                target.iter_mut().zip(row).for_each(|(target, value)| *target += factor * value);
            }
        } else {
            let slots = all.slots(&active(self.mask));
            for (k, (row, target)) in self.rows().zip(targets).enumerate() {
                let factor = factor(k);
                slots.iter().zip(row).for_each(|(&slot, value)| target[slot] += factor * value);
            }
        }
    }

    /// The columns whose magnitude is somewhere more than `least` of its unknown.
    pub(crate) fn noticeable(&self, least: impl Fn(usize) -> f32) -> u64 {
        noticeable(active(self.mask), self.rows().enumerate().map(|(k, row)| (row, least(k))))
    }
}

/// What the columns of `mask` take.
fn active(mask: u64) -> Active {
    Active::of::<f32>(mask)
}

/// Numbers of a cache line.
pub(crate) const LINE: usize = <f32 as Real>::LINE;

/// The columns in which some of the rows, `active` ones, is more than the magnitude beside it.
pub(crate) fn noticeable<'a>(active: Active, rows: impl Iterator<Item = (&'a [f32], f32)>) -> u64 {
    let mut seen = [false; MOST_COLUMNS];
    for (row, least) in rows {
        for (seen, row) in seen.as_chunks_mut::<LINE>().0.iter_mut().zip(row.as_chunks::<LINE>().0) {
            seen.iter_mut().zip(row).for_each(|(seen, value)| *seen |= value.abs() > least);
        }
    }
    let columns = active.columns().zip(seen).filter(|&(_, seen)| seen);
    columns.fold(0, |mask, (column, _)| mask | 1 << column)
}

/// Rows of neighbouring fronts under construction.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    chunks: Vec<Buffer<f32>>,
    /// How much of the last chunk is used.
    used: usize,
}

/// Numbers of a chunk. The allocator asks the system for pages of its own from twice as many on: fresh ones, while smaller
/// pieces are in memory that has been used before.
const CHUNK: usize = 1 << 14;

impl Builder {
    /// Room for the rows of a front, all zero.
    fn add(&mut self, mask: u64, count: usize) -> (Place, &mut [f32]) {
        let len = count * active(mask).width;
        if self.chunks.last().is_none_or(|chunk| chunk.len() < self.used + len) {
            self.chunks.push(Buffer::zeroed(len.max(CHUNK)));
            self.used = 0;
        }
        let (chunk, start) = (self.chunks.len() - 1, self.used);
        self.used += len;
        (Place { mask, chunk: chunk as u32, start, len }, &mut self.chunks[chunk][start..start + len])
    }

    /// Adds the columns of `mask` of a front's rows.
    pub(crate) fn add_columns(&mut self, rows: FrontRows, count: usize, mask: u64) -> Place {
        let (place, target) = self.add(mask, count);
        if mask == rows.mask {
            target.copy_from_slice(rows.values);
        } else {
            let (kept, slots) = (active(mask), active(rows.mask).slots(&active(mask)));
            for (target, row) in target.chunks_exact_mut(kept.width.max(1)).zip(rows.rows()) {
                target.iter_mut().zip(&*slots).for_each(|(target, &slot)| *target = row[slot]);
            }
        }
        place
    }

    /// What was built.
    pub(crate) fn into_chunks(self) -> Vec<Buffer<f32>> {
        self.chunks
    }

    /// Takes over what another one has made of the fronts at `places`.
    pub(crate) fn append(&mut self, other: Self, places: &mut [Place]) {
        places.iter_mut().for_each(|place| place.chunk += self.chunks.len() as u32);
        if !other.chunks.is_empty() {
            self.chunks.extend(other.chunks);
            self.used = other.used;
        }
    }
}

/// Where the fronts of a factorisation are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout<'f> {
    pub(crate) tree: Option<&'f Tree>,
    pub(crate) unknowns: usize,
}

/// Runs of fronts whose rows a worker collects at a time.
const RUNS: usize = 16;

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
        let rows = |builder: &mut Builder, (entries, ends): &mut (Vec<(u32, f64)>, Vec<usize>), front: usize| {
            let places = self.places(front);
            entries.clear();
            ends.clear();
            for place in places.clone() {
                append(self.unknown(place), entries);
                ends.push(entries.len());
            }
            let mask = entries.iter().fold(0, |mask, &(column, _)| mask | 1 << column);
            let active = active(mask);
            let mut slots = [0; MOST_COLUMNS];
            active.columns().zip(0..).for_each(|(column, slot)| slots[column] = slot);
            let (place, values) = builder.add(mask, places.len());
            let mut start = 0;
            for (row, end) in values.chunks_exact_mut(active.width.max(1)).zip(ends.iter()) {
                entries[start..*end].iter().for_each(|&(column, value)| row[slots[column as usize]] += value as f32);
                start = *end;
            }
            place
        };
        let fronts_a_run = self.front_count().div_ceil(RUNS).max(1);
        let run = |first: usize| {
            let (mut builder, mut lists) = (Builder::default(), Default::default());
            let fronts = first..self.front_count().min(first + fronts_a_run);
            let places: Vec<Place> = fronts.map(|front| rows(&mut builder, &mut lists, front)).collect();
            (builder, places)
        };
        let runs = (0..self.front_count().div_ceil(fronts_a_run)).into_par_iter().map(|k| run(k * fronts_a_run));
        let runs: Vec<_> = runs.collect();
        let (mut all, mut fronts) = (Builder::default(), Vec::with_capacity(self.front_count()));
        for (builder, mut places) in runs {
            all.append(builder, &mut places);
            fronts.extend(places);
        }
        SparseRows { tree: self.tree, fronts, chunks: all.into_chunks() }
    }

    /// The sum of `terms`, each with a factor for every unknown.
    pub(crate) fn sum<'a>(self, terms: &'a [Term<'a, 'f>]) -> Sum<'a, 'f> {
        Sum { layout: self, terms }
    }

    /// The rows of a solution whose first columns are `row` of each unknown.
    pub(crate) fn only_front<'r, I: Iterator<Item = f64> + 'r>(
        self,
        row: impl Fn(usize) -> I + Sync,
        least: impl Fn(usize) -> f64,
        columns: usize,
    ) -> SparseRows<'f> {
        let mask = if columns == MOST_COLUMNS { u64::MAX } else { (1 << columns) - 1 };
        let width = active(mask).width;
        let mut values = vec![0.0; self.unknowns * width];
        for (k, target) in values.chunks_exact_mut(width.max(1)).enumerate() {
            target.iter_mut().zip(row(k)).for_each(|(target, value)| *target = value as f32);
        }
        let (rows, mut builder) = (FrontRows { mask, values: &values }, Builder::default());
        let place = builder.add_columns(rows, self.unknowns, rows.noticeable(|k| least(k) as f32));
        SparseRows { tree: None, fronts: vec![place], chunks: builder.into_chunks() }
    }
}

/// Rows and a factor for each unknown.
pub type Term<'a, 'f> = (&'a SparseRows<'f>, &'a (dyn Fn(usize) -> f64 + Sync));

/// A sum that is added up where it is needed.
pub(crate) struct Sum<'a, 'f> {
    layout: Layout<'f>,
    terms: &'a [Term<'a, 'f>],
}

impl Sum<'_, '_> {
    /// The same with zeros, in the order of the columns, of a factorisation without fronts.
    pub(crate) fn to_dense(&self) -> RightHandSides {
        let (n, mask) = (self.layout.unknowns, self.mask(0));
        let columns = 64 - mask.leading_zeros() as usize;
        let active = active(mask);
        let mut sum = vec![0.0; n * active.width];
        self.put(0, active, &mut sum);
        let mut values = vec![0.0; n * columns];
        for (target, row) in values.chunks_exact_mut(columns.max(1)).zip(sum.chunks_exact(active.width.max(1))) {
            active.columns().zip(row).for_each(|(column, &value)| target[column] = value.into());
        }
        RightHandSides::dense(n, columns, values)
    }
}

impl Given<f32> for Sum<'_, '_> {
    fn mask(&self, front: usize) -> u64 {
        self.terms.iter().fold(0, |mask, (rows, _)| mask | rows.fronts[front].mask)
    }

    fn put(&self, front: usize, active: Active, y: &mut [f32]) {
        let first = self.layout.places(front).start;
        for (rows, factor) in self.terms {
            rows.front(front).add_to(active, y, |k| factor(self.layout.unknown(first + k)) as f32);
        }
    }
}

impl SparseRows<'_> {
    fn front(&self, front: usize) -> FrontRows<'_> {
        let Place { mask, chunk, start, len } = self.fronts[front];
        let values = if len == 0 { &[] } else { &self.chunks[chunk as usize][start..start + len] };
        FrontRows { mask, values }
    }

    /// The smallest of the values whose magnitude is `least` or more.
    pub fn minimum(&self, least: f64) -> f64 {
        let smaller = |so_far: f64, &value: &f32| {
            let value = f64::from(value);
            if value.abs() >= least { so_far.min(value) } else { so_far }
        };
        let of_front = |front: usize| self.front(front).values.iter().fold(f64::INFINITY, smaller);
        let fronts = (0..self.fronts.len()).into_par_iter().with_min_len(64);
        fronts.map(of_front).reduce(|| f64::INFINITY, f64::min)
    }

    /// The sum of all columns times their `share`, of each of `n` unknowns.
    pub(crate) fn combined(&self, n: usize, share: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; n];
        for front in 0..self.fronts.len() {
            let rows = self.front(front);
            let shares: Vec<f64> = active(rows.mask).columns().map(&share).collect();
            let of_rows = rows.rows().map(|row| shares.iter().zip(row).map(|(share, &x)| share * f64::from(x)).sum());
            match self.tree {
                None => of_rows.zip(&mut sums).for_each(|(sum, place)| *place = sum),
                Some(tree) => {
                    let first = tree.fronts[front].start;
                    of_rows.zip(first..).for_each(|(sum, place)| sums[tree.order[place] as usize] = sum);
                }
            }
        }
        sums
    }

    /// Columns and values of one unknown, by column, without those that are not stored.
    pub fn row(&self, unknown: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let (active, values) = self.stored(unknown);
        active.columns().map(|column| column as u32).zip(values.iter().map(|&value| f64::from(value)))
    }

    /// Calls `visit` with them.
    pub fn for_each_in_row(&self, unknown: usize, mut visit: impl FnMut(usize, f64)) {
        let (active, values) = self.stored(unknown);
        let mut left = active.mask;
        for &value in values {
            if left == 0 {
                break;
            }
            visit(left.trailing_zeros() as usize, f64::from(value));
            left &= left - 1;
        }
    }

    /// Columns and values of one unknown, padded.
    fn stored(&self, unknown: usize) -> (Active, &[f32]) {
        let (front, row) = match self.tree {
            None => (0, unknown),
            Some(tree) => {
                let place = tree.place[unknown] as usize;
                let front = tree.front_of[place] as usize;
                (front, place - tree.fronts[front].start)
            }
        };
        let FrontRows { mask, values } = self.front(front);
        let active = active(mask);
        (active, &values[row * active.width..][..active.width])
    }
}
