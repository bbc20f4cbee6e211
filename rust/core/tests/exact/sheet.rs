//! A small sheet and what is known of it, for tests of filling.

use crate::common::{Fixture, noise};
use skinwright_core::fill::{Constraint, Filled, Row};

pub const COLUMNS: usize = 3;

/// A curved sheet of 6 x 5 vertices, some of its triangles obtuse.
pub fn sheet() -> Fixture {
    let position = |k: usize| {
        let (i, j) = ((k / 5) as f64, (k % 5) as f64);
        let [a, b, c] = [0, 1, 2].map(|axis| 0.7 * noise(k as u64, axis));
        [(i + a) as f32, (j + b) as f32, (0.1 * i * i + c) as f32]
    };
    let quad = |k: usize| {
        let i = (k / 4 * 5 + k % 4) as u32;
        [[i, i + 5, i + 6], [i, i + 6, i + 1]]
    };
    Fixture::new("sheet", (0..30).map(position).collect(), (0..20).flat_map(quad).collect())
}

/// A curved sheet of m x n vertices, about one unit apart.
pub fn wide_sheet(m: usize, n: usize) -> Fixture {
    let position = |k: usize| {
        let (i, j) = ((k / n) as f64, (k % n) as f64);
        let [a, b, c] = [0, 1, 2].map(|axis| 0.4 * noise(k as u64, axis));
        [(i + a) as f32, (j + b) as f32, (0.1 * i + c) as f32]
    };
    let quad = |k: usize| {
        let i = (k / (n - 1) * n + k % (n - 1)) as u32;
        let n = n as u32;
        [[i, i + n, i + n + 1], [i, i + n + 1, i + 1]]
    };
    Fixture::new("wide sheet", (0..m * n).map(position).collect(), (0..(m - 1) * (n - 1)).flat_map(quad).collect())
}

/// The row given for vertex i, dense.
pub fn given_row(i: usize) -> [f64; COLUMNS] {
    let x = [0, 1, 2].map(|column| noise(i as u64, 10 + column));
    // Not every vertex has every column.
    let x = [x[0], if i.is_multiple_of(2) { x[1] } else { 0.0 }, if i.is_multiple_of(3) { x[2] } else { 0.0 }];
    x.map(|value| value / x.iter().sum::<f64>())
}

pub fn push_given(i: u32, row: &mut Row) {
    let entries = std::iter::zip(0.., given_row(i as usize));
    row.extend(entries.filter(|&(_, value)| value > 0.0));
}

pub fn row_of(filled: &Filled<'_>, i: usize) -> [f64; COLUMNS] {
    let (mut row, mut dense) = (Row::new(), [0.0; COLUMNS]);
    filled.append_row(i, &mut row);
    assert!(row.is_sorted_by(|a, b| a.0 < b.0), "row {i}: {row:?}");
    row.iter().for_each(|&(column, value)| dense[column as usize] += value);
    dense
}

/// Fixed at one end, soft here and there, otherwise free.
pub fn mixed(i: usize) -> Constraint {
    match i {
        0..3 | 17 => Constraint::Fixed,
        _ if i % 4 == 1 => Constraint::Soft(0.2 + noise(i as u64, 3)),
        _ => Constraint::Free,
    }
}

pub fn confidence(constraint: Constraint) -> f64 {
    if let Constraint::Soft(confidence) = constraint { confidence } else { 0.0 }
}

pub fn assert_rows(filled: &Filled<'_>, expected: impl Fn(usize) -> Vec<f64>, count: usize, tolerance: f64) {
    for i in 0..count {
        for (found, expected) in std::iter::zip(row_of(filled, i), expected(i)) {
            assert!((found - expected).abs() <= tolerance, "vertex {i}: {found} is not {expected}");
        }
    }
}
