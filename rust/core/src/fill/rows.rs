//! The rows that are given, and those of vertices that are one.

use rayon::prelude::*;

use super::constraint::{Constraint, Known};
use crate::weld::Weld;

/// Lists of many vertices in one piece of memory.
#[derive(Debug, Clone)]
pub struct Ragged<T> {
    /// Where each list starts, (V+1).
    starts: Vec<usize>,
    values: Vec<T>,
}

/// Lists a worker makes at a time.
const LISTS_A_RUN: usize = 2048;
/// Likely length of a list.
const LIKELY: usize = 8;

impl<T: Copy + Send + Sync> Ragged<T> {
    /// `append(i, out)` appends the list of each of `count` vertices to `out`, on several threads.
    pub fn new(count: usize, append: impl Fn(usize, &mut Vec<T>) + Sync) -> Self {
        let run = |first: usize| {
            let (mut ends, mut values) = (Vec::with_capacity(LISTS_A_RUN), Vec::with_capacity(LIKELY * LISTS_A_RUN));
            for i in first..(first + LISTS_A_RUN).min(count) {
                append(i, &mut values);
                ends.push(values.len());
            }
            (ends, values)
        };
        let runs = (0..count.div_ceil(LISTS_A_RUN)).into_par_iter().map(|k| run(k * LISTS_A_RUN));
        let runs: Vec<(Vec<usize>, Vec<T>)> = runs.collect();
        let mut all = Self { starts: Vec::with_capacity(count + 1), values: Vec::new() };
        all.values.reserve_exact(runs.iter().map(|(_, values)| values.len()).sum());
        all.starts.push(0);
        for (ends, values) in runs {
            let offset = all.values.len();
            all.starts.extend(ends.iter().map(|end| offset + end));
            all.values.extend_from_slice(&values);
        }
        all
    }

    /// The list of vertex `i`.
    pub fn of(&self, i: usize) -> &[T] {
        &self.values[self.starts[i]..self.starts[i + 1]]
    }
}

/// Columns and values of one vertex, by column.
pub type Row = Vec<(u32, f64)>;

/// The given rows: `row(i, out)` appends columns and values of vertex i to `out`, by column. It is asked only for vertices
/// that are [`Constraint::Fixed`] or [`Constraint::Soft`], in any order and from several threads.
pub type GivenRows<'a> = &'a (dyn Fn(u32, &mut Row) + Sync);

/// The given rows as the mesh that is solved on sees them.
#[derive(Clone, Copy)]
pub(super) struct KnownRows<'a> {
    pub known: &'a Known,
    pub weld: Option<&'a Weld>,
    pub given: GivenRows<'a>,
}

impl KnownRows<'_> {
    /// The row known for vertex `i` of the mesh that is solved on.
    pub fn row(&self, i: u32) -> Row {
        let mut row = Row::new();
        self.append(i, &mut row);
        row
    }

    /// Appends it to `out`: of vertices that are one, the first fixed row, or the mean of the soft ones by confidence.
    pub fn append(&self, i: u32, out: &mut Row) {
        let Some(weld) = self.weld else { return (self.given)(i, out) };
        let members = weld.members(i as usize);
        let is_fixed = |&&i: &&u32| self.known.given[i as usize] == Constraint::Fixed;
        if let [only] = members {
            (self.given)(*only, out);
        } else if let Some(&first) = members.iter().find(is_fixed) {
            (self.given)(first, out);
        } else {
            self.append_mean(members, self.known.confidence(i), out);
        }
    }

    fn append_mean(&self, members: &[u32], sum: f64, out: &mut Row) {
        let start = out.len();
        for &i in members {
            if let Constraint::Soft(b) = self.known.given[i as usize] {
                let before = out.len();
                (self.given)(i, out);
                out[before..].iter_mut().for_each(|(_, value)| *value *= b / sum);
            }
        }
        out[start..].sort_by_key(|&(column, _)| column);
        merge_equal_columns(out, start);
    }
}

/// Adds up equal neighbours of `row[start..]`.
fn merge_equal_columns(row: &mut Row, start: usize) {
    let mut end = start;
    for at in start..row.len() {
        if end > start && row[end - 1].0 == row[at].0 {
            row[end - 1].1 += row[at].1;
        } else {
            row[end] = row[at];
            end += 1;
        }
    }
    row.truncate(end);
}
