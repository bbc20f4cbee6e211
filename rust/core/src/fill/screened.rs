//! Rows pulled towards given ones over a length h of their own, four solves with one factor.
//!
//! What is wanted minimises `sum_j w_j' S M^-1 S w_j + sum_i M_i / h_i^4 |w_i - s_i|^2`: waves longer than h stay, shorter ones
//! vanish, and a row trusted over twice the length counts a sixteenth. Its matrix couples two-rings; at a million vertices the
//! factor would need more memory than a workstation has. A = S + C with `C = a M / h^2` couples one-rings, and `A M^-1 A` is
//! like the wanted matrix: equal for short waves, within a factor of two for all others where h varies slowly. Hence
//!
//! ```text
//! X1 = A^-1 (C s + g)      X2 = A^-1 (C X1 + g)                      smoothed twice
//! U = A^-1 C^2 M^-1 ((s - X2) / a^2 + X1 - X2)                       the defect of X2 in the wanted equation
//! W = A^-1 (C X2 + M U + g)                                          X2 with one step of correction
//! ```
//!
//! which needs no product with S, since `S X2 = C (X1 - X2) + g`. g is what detail and fixed rows bring: `S_t s`, S with each
//! edge scaled by the share t of its change that is to be kept (gradient-domain blending: Pérez, Gangnet, Blake, *Poisson Image
//! Editing*, SIGGRAPH 2003, doi 10.1145/882262.882269).
//!
//! Influence dies away within a few h, so a column is zero in most of the mesh. A few columns are solved at a time, and each
//! substitution leaves out the subtrees that they do not reach.

use rayon::prelude::*;
use skinwright_solve::{RightHandSides, Solution};

use super::block::{Block, BlockRows, Places};
use super::rows::Ragged;
use crate::adjacency::NONE;
use crate::error::Result;
use crate::laplacian::Laplacian;
use crate::progress::Progress;

/// a: how much shorter the two smoothing solves reach than the wanted energy. From 1.25 to 2.5 figures are alike.
const REACH: f64 = 1.5;
/// Columns solved together: a vector of numbers in the substitution.
const WIDTH: usize = 8;
/// Groups of columns under way at a time, for the sake of memory.
const GROUPS: usize = 4;
/// Magnitude that counts as zero between solves.
const NEGLIGIBLE: f64 = 1e-7;
/// Least magnitude of a weight that is handed on.
const LEAST: f64 = 1e-5;

/// Columns and values of every vertex of the mesh that is solved on, empty where none are known.
pub type RowTable = Ragged<(u32, f64)>;

/// Values of a group of columns for one vertex.
type Values = [f64; WIDTH];

/// The confidence that makes a row with this `mass` trusted over this `length`.
pub fn confidence(mass: f64, length: f64) -> f64 {
    REACH * mass / (length * length)
}

/// What is given to all blocks.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    pub laplacian: &'a Laplacian,
    /// (V)
    pub rows: &'a RowTable,
    /// Share of the change along each edge that is kept, in the order of the Laplacian's rows, (V).
    pub kept: &'a Ragged<f64>,
    /// Place of every unknown in its block, (V).
    pub number: &'a [u32],
}

/// One block with what all of its columns need. Its vertices are the unknowns first, then those around.
struct Screened<'a> {
    block: &'a Block,
    rows: &'a RowTable,
    /// For each unknown: vertices around whose change is kept, and with what weight.
    kept: Ragged<(u32, f64)>,
    /// C and M of the unknowns.
    confidence: Vec<f64>,
    mass: Vec<f64>,
    /// The smallest C / M of soft unknowns.
    least_ratio: f64,
}

/// Solves a block.
///
/// # Errors
/// Those of [`Block::accuracy`], [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn solve<'b>(block: &'b Block, given: Given<'_>, progress: &Progress) -> Result<BlockRows<'b>> {
    let screened = Screened::new(block, given);
    if let Some((column, value)) = screened.only_row() {
        return Ok(BlockRows::constant(column, value));
    }
    let accuracy = block.accuracy()?;
    let columns = screened.columns();
    let places = Places::of(&columns).of_column;
    let groups: Vec<&[u32]> = columns.chunks(WIDTH).collect();
    let mut found = Vec::with_capacity(groups.len());
    for (first, groups) in std::iter::zip((0..).step_by(GROUPS), groups.chunks(GROUPS)) {
        let solve = |(k, columns): (usize, &&[u32])| {
            progress.check()?;
            Ok(Group { screened: &screened, columns, places: &places, first: (first + k) * WIDTH }.solve())
        };
        found.extend(groups.par_iter().enumerate().map(solve).collect::<Result<Vec<_>>>()?);
    }
    let append =
        |k: usize, out: &mut Vec<(u32, f64)>| found.iter().for_each(|group| out.extend_from_slice(group.of(k)));
    Ok(BlockRows::sparse(Ragged::new(block.unknowns().len(), append), accuracy))
}

impl<'a> Screened<'a> {
    fn new(block: &'a Block, given: Given<'a>) -> Self {
        let unknowns = block.unknowns();
        let mut confidence = vec![0.0; unknowns.len()];
        block.soft.iter().for_each(|&(k, value)| confidence[k as usize] = value);
        let mass: Vec<f64> = unknowns.iter().map(|&i| given.laplacian.mass(i as usize)).collect();
        let ratios = block.soft.iter().map(|&(k, value)| value / mass[k as usize]);
        let least_ratio = ratios.fold(f64::INFINITY, f64::min);
        let kept = Ragged::new(unknowns.len(), |k, out| append_kept(block, given, &confidence, k, out));
        Self { block, rows: given.rows, kept, confidence, mass, least_ratio }
    }

    fn count(&self) -> usize {
        self.block.unknowns().len()
    }

    /// The row given for a vertex, unknown or around.
    fn row(&self, local: usize) -> &[(u32, f64)] {
        let (unknowns, around) = (self.block.unknowns(), &self.block.boundary.vertices);
        self.rows.of(unknowns.get(local).map_or_else(|| around[local - unknowns.len()], |&i| i) as usize)
    }

    fn vertices(&self) -> std::ops::Range<usize> {
        0..self.count() + self.block.boundary.vertices.len()
    }

    /// Column and value of the row that all vertices have whose row is known, if it has no other.
    fn only_row(&self) -> Option<(u32, f64)> {
        let mut rows = self.vertices().map(|local| self.row(local)).filter(|row| !row.is_empty());
        let &[only] = rows.next()? else { return None };
        rows.all(|row| *row == [only]).then_some(only)
    }

    /// All columns of the known rows, ascending.
    fn columns(&self) -> Vec<u32> {
        let mut is_used = Vec::new();
        for &(column, _) in self.vertices().flat_map(|local| self.row(local)) {
            if is_used.len() <= column as usize {
                is_used.resize(column as usize + 1, false);
            }
            is_used[column as usize] = true;
        }
        std::iter::zip(0.., is_used).filter(|&(_, is_used)| is_used).map(|(column, _)| column).collect()
    }
}

/// Appends the vertices around unknown `k` that keep some of their change to it.
fn append_kept(block: &Block, given: Given<'_>, confidence: &[f64], k: usize, out: &mut Vec<(u32, f64)>) {
    if confidence[k] == 0.0 {
        return;
    }
    let i = block.unknowns()[k] as usize;
    let (neighbours, cotangents) = given.laplacian.row(i);
    for ((&j, cotangent), share) in std::iter::zip(std::iter::zip(neighbours, cotangents), given.kept.of(i)) {
        let there = given.rows.of(j as usize);
        if cotangent * share == 0.0 || there.is_empty() || there == given.rows.of(i) {
            continue;
        }
        let local = match given.number[j as usize] {
            NONE => block.boundary.vertices.binary_search(&j).map(|at| (block.unknowns().len() + at) as u32),
            place => Ok(place),
        };
        out.extend(local.map(|local| (local, cotangent * share)));
    }
}

/// A few columns of a block.
struct Group<'a> {
    screened: &'a Screened<'a>,
    columns: &'a [u32],
    /// Place of every column among the block's.
    places: &'a [u32],
    /// The place of the group's first column.
    first: usize,
}

/// s and g of a group of columns.
struct Data {
    /// (unknowns and vertices around)
    rows: Vec<Values>,
    has_row: Vec<bool>,
    /// (unknowns)
    added: Vec<Values>,
}

impl Group<'_> {
    /// Columns and values of the unknowns.
    fn solve(&self) -> Ragged<(u32, f64)> {
        let Screened { confidence, mass, least_ratio, .. } = self.screened;
        let data = self.data();
        let pulled = |k: usize, towards: &Values| combine(&data.added[k], confidence[k], towards);
        let first = self.substitute(|k| pulled(k, &data.rows[k]), NEGLIGIBLE);
        let first = |k: usize| settled(&first, k);
        let second = self.substitute(|k| pulled(k, &first(k)), NEGLIGIBLE);
        let second = |k: usize| settled(&second, k);
        let defect = |k: usize| {
            let scale = confidence[k] * confidence[k] / mass[k];
            let (given, first, second) = (&data.rows[k], first(k), second(k));
            std::array::from_fn(|c| scale * ((given[c] - second[c]) / (REACH * REACH) + first[c] - second[c]))
        };
        let correction = self.substitute(defect, NEGLIGIBLE * least_ratio);
        let corrected = |k: usize| {
            let least = NEGLIGIBLE * confidence[k].max(mass[k] * least_ratio);
            let step = values(&correction, k).map(|x| if (mass[k] * x).abs() > least { mass[k] * x } else { 0.0 });
            combine(&step, 1.0, &pulled(k, &second(k)))
        };
        let answer = self.substitute(corrected, NEGLIGIBLE);
        Ragged::new(self.screened.count(), |k, out| {
            let row = std::iter::zip(self.columns, values(&answer, k));
            out.extend(row.filter(|(_, value)| value.abs() >= LEAST).map(|(&column, value)| (column, value)));
        })
    }

    fn data(&self) -> Data {
        let (screened, count) = (self.screened, self.screened.count());
        let mut data =
            Data { rows: vec![[0.0; WIDTH]; screened.vertices().len()], has_row: Vec::new(), added: Vec::new() };
        data.has_row = vec![false; data.rows.len()];
        for local in screened.vertices() {
            for &(column, value) in screened.row(local) {
                let slot = (self.places[column as usize] as usize).wrapping_sub(self.first);
                if slot < WIDTH {
                    data.rows[local][slot] = value;
                    data.has_row[local] = true;
                }
            }
        }
        data.added = vec![[0.0; WIDTH]; count];
        for k in 0..count {
            self.add(&mut data, k);
        }
        data
    }

    /// Adds up g of unknown `k`.
    fn add(&self, data: &mut Data, k: usize) {
        let boundary = &self.screened.block.boundary;
        for &(j, weight) in self.screened.kept.of(k) {
            if data.has_row[k] || data.has_row[j as usize] {
                let change: Values = std::array::from_fn(|c| data.rows[k][c] - data.rows[j as usize][c]);
                data.added[k] = combine(&data.added[k], weight, &change);
            }
        }
        for at in boundary.starts[k]..boundary.starts[k + 1] {
            let around = self.screened.count() + boundary.columns[at] as usize;
            if data.has_row[around] {
                data.added[k] = combine(&data.added[k], -boundary.values[at], &data.rows[around]);
            }
        }
    }

    fn substitute(&self, right_hand_side: impl Fn(usize) -> Values, negligible: f64) -> Solution<'_> {
        let count = self.screened.count();
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for k in 0..count {
            let row = right_hand_side(k);
            if row != [0.0; WIDTH] {
                rows.push(k as u32);
                values.extend_from_slice(&row);
            }
        }
        let right_hand_sides = RightHandSides::sparse(count, WIDTH, &rows, values);
        self.screened.block.factor.solve_nearby(&right_hand_sides, negligible)
    }
}

fn combine(row: &Values, factor: f64, other: &Values) -> Values {
    std::array::from_fn(|c| row[c] + factor * other[c])
}

/// The solution for one unknown.
fn values(solution: &Solution<'_>, k: usize) -> Values {
    std::array::from_fn(|c| solution.leading(k)[c])
}

/// The same without what is negligible.
fn settled(solution: &Solution<'_>, k: usize) -> Values {
    values(solution, k).map(|x| if x.abs() > NEGLIGIBLE { x } else { 0.0 })
}
