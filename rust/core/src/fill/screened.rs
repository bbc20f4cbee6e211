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
//! Influence dies away within a few h, so a column is zero in most of the mesh, and is not even stored there. For the same
//! reason a part of the mesh can be solved again by itself, held at what each of the four solves has found around it ([`Patch`]).

use skinwright_solve::{MOST_COLUMNS, SparseRows, SparseSolver, Term, Workspace};

use super::block::{Block, BlockRows, CORRECTION, Places, SOLVES, Solves, SparseColumns};
use super::doubt::{DOUBTFUL, solved_with_care};
use super::rows::Ragged;
use crate::adjacency::NONE;
use crate::error::Result;
use crate::laplacian::Laplacian;
use crate::progress::Progress;

/// a: how much shorter the two smoothing solves reach than the wanted energy. From 1.25 to 2.5 figures are alike.
const REACH: f64 = 1.5;
/// Magnitude that counts as zero between solves. Single precision errs by less where lengths are some tens of edges.
const NEGLIGIBLE: f64 = 1e-6;
/// Least magnitude of a weight that is handed on.
const LEAST: f64 = 1e-5;

/// Blocks with more unknowns than this collect some rows twice instead of holding them, for the sake of memory.
const MANY: usize = 300_000;

/// Columns and values of every vertex of the mesh that is solved on, empty where none are known.
pub type RowTable = Ragged<(u32, f64)>;

/// What each of the four solves has found, X1, X2, U and W in this order: columns and values of every vertex of the mesh that
/// is solved on, empty where nothing was solved for.
#[derive(Debug)]
pub struct Found(pub(super) [Ragged<(u32, f32)>; SOLVES]);

/// Makes the problem a part of a larger one: some fixed vertices, the `held` ones (V), are not fixed there, and have the values
/// that each solve of the larger problem has `found`.
#[derive(Debug, Clone, Copy)]
pub struct Patch<'a> {
    /// What was found.
    pub found: &'a Found,
    /// Who has these values.
    pub is_held: &'a [bool],
}

/// What a screened problem is made of, besides constraints.
#[derive(Debug, Clone, Copy)]
pub struct Screen<'a> {
    /// The [table](super::Fill::row_table) of the given rows.
    pub rows: &'a RowTable,
    /// Share of the change of these rows along each edge that stays whatever the lengths, in the order of the Laplacian's
    /// rows, (V); where both ends have a list, that of the lower index counts.
    pub kept: &'a Ragged<f64>,
    /// If this is only a part of a problem.
    pub patch: Option<Patch<'a>>,
    /// Whether all four solves are wanted, see [`super::Filled::found`].
    pub with_all_solves: bool,
}

/// The confidence that makes a row with this `mass` trusted over this `length`.
pub fn confidence(mass: f64, length: f64) -> f64 {
    REACH * mass / (length * length)
}

/// What is given to all blocks.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    pub laplacian: &'a Laplacian,
    pub screen: Screen<'a>,
    /// Place of every unknown in its block, (V).
    pub number: &'a [u32],
}

/// One block with what all of its columns need. Its vertices are the unknowns first, then those around.
struct Screened<'a, 'b> {
    block: &'b Block,
    screen: Screen<'a>,
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
/// Those of [`Block::examine`], [`Error::Cancelled`](crate::Error::Cancelled).
pub(super) fn solve<'b>(block: &'b Block, given: Given<'_>, progress: &Progress) -> Result<BlockRows<'b>> {
    let screened = Screened::new(block, given);
    if let Some((column, value)) = screened.only_row() {
        return Ok(BlockRows::constant(column, value));
    }
    solved_with_care(|| screened.solve(progress), BlockRows::residual, || block.examine())
}

impl<'a, 'b> Screened<'a, 'b> {
    fn new(block: &'b Block, given: Given<'a>) -> Self {
        let unknowns = block.unknowns();
        let mut confidence = vec![0.0; unknowns.len()];
        block.soft.iter().for_each(|&(k, value)| confidence[k as usize] = value);
        let mass: Vec<f64> = unknowns.iter().map(|&i| given.laplacian.mass(i as usize)).collect();
        let ratios = block.soft.iter().map(|&(k, value)| value / mass[k as usize]);
        let least_ratio = ratios.fold(f64::INFINITY, f64::min);
        let kept = Ragged::new(unknowns.len(), |k, out| append_kept(block, given, &confidence, k, out));
        Self { block, screen: given.screen, kept, confidence, mass, least_ratio }
    }

    fn solve(&self, progress: &Progress) -> Result<BlockRows<'b>> {
        let columns = self.columns();
        let (count, places) = (columns.len(), Places::of(&columns).of_column);
        let solver = self.block.factor.sparse();
        let mut residual = 0.0;
        let solve = |(first, columns): (usize, &[u32])| {
            let has_all = std::iter::zip(0.., columns).all(|(k, &column)| k == column) && columns.len() == count;
            let group = Group { screened: self, columns, places: &places, first, has_all, solver, progress };
            let (solves, error) = group.solve()?;
            residual = f64::max(residual, error);
            Ok(SparseColumns::new(columns.to_vec(), solves, LEAST))
        };
        let groups = std::iter::zip((0..).step_by(MOST_COLUMNS), columns.chunks(MOST_COLUMNS));
        let found = groups.map(solve).collect::<Result<_>>()?;
        Ok(BlockRows::sparse(found, residual))
    }

    fn count(&self) -> usize {
        self.block.unknowns().len()
    }

    /// The row given for a vertex, unknown or around.
    fn row(&self, local: usize) -> &[(u32, f64)] {
        self.screen.rows.of(self.vertex(local))
    }

    fn vertex(&self, local: usize) -> usize {
        let (unknowns, around) = (self.block.unknowns(), &self.block.boundary.vertices);
        unknowns.get(local).map_or_else(|| around[local - unknowns.len()], |&i| i) as usize
    }

    /// What the solves have found for a vertex around the unknowns, if it is held.
    fn held(&self, local: usize) -> Option<&Found> {
        let patch = self.screen.patch?;
        patch.is_held[self.vertex(local)].then_some(patch.found)
    }

    fn vertices(&self) -> std::ops::Range<usize> {
        0..self.count() + self.block.boundary.vertices.len()
    }

    /// Column and value of the row that all vertices have whose row is known, if it has no other.
    fn only_row(&self) -> Option<(u32, f64)> {
        if self.screen.patch.is_some() {
            return None;
        }
        let mut rows = self.vertices().map(|local| self.row(local)).filter(|row| !row.is_empty());
        let &[only] = rows.next()? else { return None };
        rows.all(|row| *row == [only]).then_some(only)
    }

    /// All columns of the known rows, ascending.
    fn columns(&self) -> Vec<u32> {
        let mut is_used = Vec::new();
        let mut use_column = |column: u32| {
            if is_used.len() <= column as usize {
                is_used.resize(column as usize + 1, false);
            }
            is_used[column as usize] = true;
        };
        self.vertices().flat_map(|local| self.row(local)).for_each(|&(column, _)| use_column(column));
        for local in self.vertices().skip(self.count()) {
            let found = self.held(local).into_iter().flat_map(|found| &found.0);
            found.flat_map(|rows| rows.of(self.vertex(local))).for_each(|&(column, _)| use_column(column));
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
    for ((&j, cotangent), share) in std::iter::zip(std::iter::zip(neighbours, cotangents), given.screen.kept.of(i)) {
        let there = given.screen.rows.of(j as usize);
        let share = match given.screen.kept.of(j as usize) {
            theirs if (j as usize) < i && !theirs.is_empty() => {
                let back = given.laplacian.neighbours(j as usize).iter().position(|&back| back as usize == i);
                back.map_or(0.0, |at| theirs[at])
            }
            _ => *share,
        };
        if cotangent * share == 0.0 || there.is_empty() || there == given.screen.rows.of(i) {
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
struct Group<'a, 'b> {
    screened: &'a Screened<'a, 'b>,
    columns: &'a [u32],
    /// Place of every column among the block's.
    places: &'a [u32],
    /// The place of the group's first column.
    first: usize,
    /// Whether these are all columns there are, each in its place.
    has_all: bool,
    solver: SparseSolver<'b>,
    progress: &'a Progress,
}

impl<'b> Group<'_, 'b> {
    /// Values of the unknowns, and the backward error of the first solve.
    fn solve(&self) -> Result<(Solves<'b>, f64)> {
        let Screened { confidence, mass, least_ratio, .. } = self.screened;
        let solver = self.solver;
        let add = || solver.collect(|k, out| self.add(k, out));
        let (given, added) = (solver.collect(|k, out| self.append(k, 1.0, out)), add());
        let (once, pull) = (|_: usize| 1.0, |k: usize| confidence[k]);
        let mut work = Workspace::default();
        let mut solve = |solve: usize, terms: &[Term<'_, 'b>], least: &(dyn Fn(usize) -> f64 + Sync)| {
            self.substitute(solve, terms, least, &mut work)
        };
        let (first, residual) = solve(0, &[(&given, &pull), (&added, &once)], &|_| NEGLIGIBLE)?;
        let residual = if residual > DOUBTFUL { residual * self.largest(&first).min(1.0) } else { residual };
        let (second, _) = solve(1, &[(&first, &pull), (&added, &once)], &|_| NEGLIGIBLE)?;
        let scale = |k: usize| confidence[k] * confidence[k] / mass[k];
        let to_given = |k: usize| scale(k) / (REACH * REACH);
        let to_second = |k: usize| -scale(k) * (1.0 / (REACH * REACH) + 1.0);
        let least = |k: usize| NEGLIGIBLE * (confidence[k] / mass[k]).max(*least_ratio);
        // It is not needed for the correction, and of a large block memory is scarce.
        let added = (self.screened.count() <= MANY).then_some(added);
        let terms: [Term; 3] = [(&given, &to_given), (&first, &scale), (&second, &to_second)];
        let (correction, _) = solve(CORRECTION, &terms, &least)?;
        drop(given);
        let first = self.screened.screen.with_all_solves.then_some(first);
        let added = added.unwrap_or_else(add);
        let corrected: [Term; 3] = [(&correction, &|k| mass[k]), (&second, &pull), (&added, &once)];
        let (rows, _) = solve(CORRECTION + 1, &corrected, &|_| LEAST)?;
        Ok((Solves { earlier: first.map(|first| [first, second, correction]), rows }, residual))
    }

    /// The largest magnitude of a solution.
    fn largest(&self, found: &SparseRows<'_>) -> f64 {
        let of_row = |k: usize| found.row(k).fold(0.0, |largest: f64, (_, value)| largest.max(value.abs()));
        (0..self.screened.count()).map(of_row).fold(0.0, f64::max)
    }

    /// The solution of solve number `solve` for the sum of `terms` and what is held, and of the first one the backward error.
    fn substitute(
        &self,
        solve: usize,
        terms: &[Term<'_, 'b>],
        least: &(dyn Fn(usize) -> f64 + Sync),
        work: &mut Workspace,
    ) -> Result<(SparseRows<'b>, f64)> {
        let mut substitute = |terms: &[Term<'_, 'b>]| {
            let found = self.solver.solve(terms, least, work, self.progress.stop());
            let residual = if solve == 0 { self.solver.residual(terms, &found) } else { 0.0 };
            (found, residual)
        };
        let found = match self.screened.screen.patch {
            None => substitute(terms),
            Some(_) => {
                let held = self.solver.collect(|k, out| self.add_held(solve, k, out));
                substitute(&[terms, &[(&held, &|_: usize| 1.0)]].concat())
            }
        };
        self.progress.check().map(|()| found)
    }

    /// Appends what the held vertices around unknown `k` bring to a solve.
    fn add_held(&self, solve: usize, k: usize, out: &mut Vec<(u32, f64)>) {
        let boundary = &self.screened.block.boundary;
        for at in boundary.starts[k]..boundary.starts[k + 1] {
            let local = self.screened.count() + boundary.columns[at] as usize;
            if let Some(found) = self.screened.held(local) {
                let row = found.0[solve].of(self.screened.vertex(local)).iter();
                self.append_row(row.map(|&(column, value)| (column, f64::from(value))), -boundary.values[at], out);
            }
        }
    }

    /// Appends the row given for a vertex, unknown or around, times a factor.
    fn append(&self, local: usize, factor: f64, out: &mut Vec<(u32, f64)>) {
        self.append_row(self.screened.row(local).iter().copied(), factor, out);
    }

    fn append_row(&self, row: impl Iterator<Item = (u32, f64)>, factor: f64, out: &mut Vec<(u32, f64)>) {
        if self.has_all {
            return out.extend(row.map(|(column, value)| (column, factor * value)));
        }
        let columns = 0..self.columns.len();
        out.extend(row.filter_map(|(column, value)| {
            let slot = (self.places[column as usize] as usize).wrapping_sub(self.first);
            columns.contains(&slot).then_some((slot as u32, factor * value))
        }));
    }

    /// Appends what g of unknown `k` is the sum of.
    fn add(&self, k: usize, out: &mut Vec<(u32, f64)>) {
        let kept = self.screened.kept.of(k);
        if !kept.is_empty() {
            self.append(k, kept.iter().map(|&(_, weight)| weight).sum(), out);
            kept.iter().for_each(|&(j, weight)| self.append(j as usize, -weight, out));
        }
        let boundary = &self.screened.block.boundary;
        for at in boundary.starts[k]..boundary.starts[k + 1] {
            let local = self.screened.count() + boundary.columns[at] as usize;
            if self.screened.held(local).is_none() {
                self.append(local, -boundary.values[at], out);
            }
        }
    }
}
