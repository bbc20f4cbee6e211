//! The rows that are given, and those of vertices that are one.

use super::constraint::{Constraint, Known};
use crate::weld::Weld;

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
