//! One independent block of unknowns: assembled, factored, solved for any number of columns.

use std::sync::OnceLock;

use rayon::prelude::*;
use skinwright_solve::{Cholesky, Failure, Precision, RightHandSides, Solution, SparseRows, SymmetricMatrix};

use super::constraint::Known;
use super::rows::{KnownRows, Row};
use super::system::{self, Boundary};
use crate::error::{Error, Result};
use crate::laplacian::Laplacian;
use crate::progress::Progress;

/// Backward error above which a solution is refused.
const REFUSE_ABOVE: f64 = 1e-8;
/// The same of a factor in single precision, which serves screened solves: from here on the solver looks for another factor.
const REFUSE_SINGLE_ABOVE: f64 = 1e-5;

/// How many solves lead to the rows of a screened block, see [`screened`](super::screened).
pub(super) const SOLVES: usize = 4;
/// The place of the correction among them, which is zero at fixed rows.
pub(super) const CORRECTION: usize = 2;

/// Which energy a block minimises, and how its factor is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Form {
    /// l.
    pub length: f64,
    pub precision: Precision,
}

/// The assembled system of a block of unknowns.
#[derive(Debug)]
pub struct System {
    unknowns: Vec<u32>,
    soft: Vec<(u32, f64)>,
    form: Form,
    matrix: SymmetricMatrix,
    boundary: Boundary,
}

impl System {
    /// The block's vertices, ascending.
    pub(super) fn unknowns(&self) -> &[u32] {
        &self.unknowns
    }

    /// Takes the block for that of another `form`, because its own cannot be solved.
    pub(super) fn standing_for(self, form: Form) -> Self {
        Self { form, ..self }
    }

    /// Assembles the block of `unknowns`; `number` is from [`system::number_unknowns`].
    pub(super) fn new(laplacian: &Laplacian, known: &Known, unknowns: Vec<u32>, number: &[u32], form: Form) -> Self {
        let (mut matrix, boundary) = system::assemble(laplacian, &unknowns, number, form.length);
        let soft: Vec<_> = soft_unknowns(known, &unknowns).collect();
        for &(k, confidence) in &soft {
            matrix.values[matrix.column_starts[k as usize]] += confidence;
        }
        Self { unknowns, soft, form, matrix, boundary }
    }
}

/// Which of a block's unknowns are pulled towards a row, and their confidences.
fn soft_unknowns(known: &Known, unknowns: &[u32]) -> impl Iterator<Item = (u32, f64)> {
    let with_confidence = std::iter::zip(0.., unknowns).map(|(k, &i)| (k, known.confidence(i)));
    with_confidence.filter(|&(_, confidence)| confidence > 0.0)
}

/// A factored block of unknowns. It depends on the mesh, on which vertices are unknown, on confidences and on l; never on
/// rows.
#[derive(Debug)]
pub struct Block {
    unknowns: Vec<u32>,
    /// Places of the soft unknowns and their confidences.
    pub(super) soft: Vec<(u32, f64)>,
    form: Form,
    pub(super) boundary: Boundary,
    pub(super) factor: Cholesky,
    /// Backward error of a solve whose answer is 1 everywhere, once somebody asked.
    accuracy: OnceLock<f64>,
}

/// Rows of a block's unknowns.
#[derive(Debug)]
pub struct BlockRows<'b> {
    columns: Vec<u32>,
    values: Values<'b>,
}

#[derive(Debug)]
enum Values<'b> {
    /// All rows known around the block have one column, and one value in it: so have all its unknowns, for constants cost
    /// no energy.
    Constant(f64),
    Solved(Solution<'b>),
    /// Some columns each, and the backward error of the first solve.
    Sparse(Vec<SparseColumns<'b>>, f64),
}

/// Some columns of a block, most of their values being zero.
#[derive(Debug)]
pub(super) struct SparseColumns<'b> {
    columns: Vec<u32>,
    solves: Solves<'b>,
    least: f64,
}

/// The solves that lead to rows of a block, see [`screened`](super::screened).
#[derive(Debug)]
pub(super) struct Solves<'b> {
    /// Those before the last, if they are kept.
    pub earlier: Option<[SparseRows<'b>; SOLVES - 1]>,
    /// The last.
    pub rows: SparseRows<'b>,
}

impl<'b> SparseColumns<'b> {
    /// `solves` store the values of `columns`; of the rows those below the `least` magnitude are left out.
    pub(super) fn new(columns: Vec<u32>, solves: Solves<'b>, least: f64) -> Self {
        Self { columns, solves, least }
    }

    /// What solve number `solve` has found for unknown `k`.
    fn found(&self, solve: usize, k: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let earlier = self.solves.earlier.iter().flatten().nth(solve);
        let row = earlier.unwrap_or(&self.solves.rows).row(k);
        row.map(|(slot, value)| (self.columns[slot as usize], value))
    }

    fn minimum(&self) -> f64 {
        self.solves.rows.minimum(self.least)
    }

    fn append_row(&self, k: usize, out: &mut Row) {
        self.solves.rows.for_each_in_row(k, |slot, value| {
            if value.abs() >= self.least {
                out.push((self.columns[slot], value));
            }
        });
    }
}

impl<'b> BlockRows<'b> {
    /// These columns, by column; `residual` is the largest backward error.
    pub(super) fn sparse(rows: Vec<SparseColumns<'b>>, residual: f64) -> Self {
        Self { columns: Vec::new(), values: Values::Sparse(rows, residual) }
    }

    /// One column with one value for all unknowns.
    pub(super) fn constant(column: u32, value: f64) -> Self {
        Self { columns: vec![column], values: Values::Constant(value) }
    }

    /// Appends columns and values of the block's unknown `k` to `out`, by column.
    pub fn append_row(&self, k: usize, out: &mut Row) {
        match &self.values {
            Values::Constant(value) => out.push((self.columns[0], *value)),
            Values::Solved(solution) => out.extend(std::iter::zip(self.columns.iter().copied(), solution.row(k))),
            Values::Sparse(rows, _) => rows.iter().for_each(|columns| columns.append_row(k, out)),
        }
    }

    /// Columns and values that solve number `solve` of a screened block has found for unknown `k`, if they were all kept.
    pub(super) fn found(&self, solve: usize, k: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let (constant, sparse) = match &self.values {
            Values::Constant(value) => ((solve != CORRECTION).then_some((self.columns[0], *value)), [].as_slice()),
            Values::Sparse(rows, _) => (None, &rows[..]),
            Values::Solved(_) => (None, [].as_slice()),
        };
        constant.into_iter().chain(sparse.iter().flat_map(move |columns| columns.found(solve, k)))
    }

    /// The smallest value of the block's `count` unknowns.
    pub fn minimum(&self, count: usize) -> f64 {
        let solution = match &self.values {
            Values::Constant(value) => return *value,
            Values::Sparse(rows, _) => return rows.iter().map(SparseColumns::minimum).fold(f64::INFINITY, f64::min),
            Values::Solved(solution) => solution,
        };
        let least = |k| solution.row(k).fold(f64::INFINITY, f64::min);
        (0..count).into_par_iter().with_min_len(256).map(least).reduce(|| f64::INFINITY, f64::min)
    }

    /// Backward error of the solve.
    pub fn residual(&self) -> f64 {
        match &self.values {
            Values::Constant(_) => 0.0,
            Values::Solved(solution) => solution.residual(),
            Values::Sparse(_, residual) => *residual,
        }
    }
}

impl Block {
    /// Factors an assembled block; `positions` are those of all vertices.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] with a vertex of the block, [`Error::Cancelled`].
    pub fn new(positions: &[[f32; 3]], system: System, progress: &Progress) -> Result<Self> {
        let System { unknowns, soft, form, matrix, boundary } = system;
        let positions: Vec<_> = unknowns.iter().map(|&i| positions[i as usize].into()).collect();
        let factor = Cholesky::factor_in(form.precision, matrix, &positions, progress.stop());
        let factor = factor.map_err(|failure| match failure {
            Failure::NotPositive(failed) => Error::NotPositiveDefinite { vertex: unknowns[failed.unknown] as usize },
            Failure::Stopped => Error::Cancelled,
        })?;
        Ok(Self { unknowns, soft, form, boundary, factor, accuracy: OnceLock::new() })
    }

    /// The block's vertices, ascending.
    pub fn unknowns(&self) -> &[u32] {
        &self.unknowns
    }

    /// Whether this factorisation serves the block of `unknowns` with the confidences of `known` in this `form`.
    pub(super) fn serves(&self, unknowns: &[u32], known: &Known, form: Form) -> bool {
        self.form == form && self.unknowns == unknowns && soft_unknowns(known, unknowns).eq(self.soft.iter().copied())
    }

    /// Rows of the unknowns.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the backward error stays above 1e-8.
    pub(super) fn solve(&self, known: KnownRows<'_>) -> Result<BlockRows<'_>> {
        let fixed: Vec<Row> = self.boundary.vertices.par_iter().map(|&i| known.row(i)).collect();
        let soft: Vec<Row> = self.soft.par_iter().map(|&(k, _)| known.row(self.unknowns[k as usize])).collect();
        let rows = || fixed.iter().chain(&soft);
        let mut columns: Vec<u32> = rows().flatten().map(|&(column, _)| column).collect();
        columns.sort_unstable();
        columns.dedup();
        if let Some([(column, value)]) = rows().next().map(Vec::as_slice)
            && rows().all(|row| row[..] == [(*column, *value)])
        {
            return Ok(BlockRows::constant(*column, *value));
        }
        let places = Places::of(&columns);
        let own = |s: usize, row: &mut [f64]| places.add(row, &soft[s], self.soft[s].1);
        let solution = self.checked(&self.right_hand_sides(&fixed, &places, own))?;
        Ok(BlockRows { columns, values: Values::Solved(solution) })
    }

    /// Solves for 1 everywhere, so that the solver looks for another factor if this one is wrong.
    ///
    /// # Errors
    /// [`Error::NotPositiveDefinite`] if the backward error stays above what the precision of the factor allows.
    pub(super) fn examine(&self) -> Result<()> {
        let measure = || {
            let mut ones: Vec<f64> = vec![0.0; self.unknowns.len()];
            self.soft.iter().for_each(|&(k, confidence)| ones[k as usize] = confidence);
            for (one, range) in std::iter::zip(&mut ones, self.boundary.starts.windows(2)) {
                *one -= self.boundary.values[range[0]..range[1]].iter().sum::<f64>();
            }
            self.factor.solve(&RightHandSides::dense(ones.len(), 1, ones)).residual()
        };
        let accuracy = *self.accuracy.get_or_init(measure);
        let is_single = self.form.precision == Precision::Single;
        self.refuse_above(if is_single { REFUSE_SINGLE_ABOVE } else { REFUSE_ABOVE }, accuracy)
    }

    fn refuse_above(&self, limit: f64, residual: f64) -> Result<()> {
        let accurate = residual <= limit;
        accurate.then_some(()).ok_or(Error::NotPositiveDefinite { vertex: self.unknowns[0] as usize })
    }

    fn checked(&self, right_hand_sides: &RightHandSides) -> Result<Solution<'_>> {
        let solution = self.factor.solve(right_hand_sides);
        self.refuse_above(REFUSE_ABOVE, solution.residual()).map(|()| solution)
    }

    /// `diag(b) W_0 - Q_UI W_I`, (unknowns, columns); `add_soft` adds the first term for soft unknown s to a row.
    fn right_hand_sides(
        &self,
        fixed: &[Row],
        places: &Places,
        add_soft: impl Fn(usize, &mut [f64]) + Sync,
    ) -> RightHandSides {
        let mut soft_of = vec![u32::MAX; if self.soft.is_empty() { 0 } else { self.unknowns.len() }];
        std::iter::zip(0.., &self.soft).for_each(|(s, &(k, _))| soft_of[k as usize] = s);
        let soft_of = |u: u32| soft_of.get(u as usize).copied().filter(|&s| s != u32::MAX);
        let entries = |u: u32| self.boundary.starts[u as usize]..self.boundary.starts[u as usize + 1];
        let in_band = |&u: &u32| !entries(u).is_empty() || soft_of(u).is_some();
        let band: Vec<u32> = (0..self.unknowns.len() as u32).filter(in_band).collect();
        let mut values = vec![0.0; band.len() * places.count];
        values.par_chunks_mut(places.count.max(1)).zip(&band).with_min_len(256).for_each(|(row, &u)| {
            for at in entries(u) {
                places.add(row, &fixed[self.boundary.columns[at] as usize], -self.boundary.values[at]);
            }
            if let Some(s) = soft_of(u) {
                add_soft(s as usize, row);
            }
        });
        RightHandSides::sparse(self.unknowns.len(), places.count, &band, values)
    }
}

/// Where each column of a block stands among its columns.
pub(super) struct Places {
    pub of_column: Vec<u32>,
    count: usize,
}

impl Places {
    /// Of `columns`, ascending.
    pub fn of(columns: &[u32]) -> Self {
        let mut of_column = vec![0; columns.last().map_or(0, |&column| column as usize + 1)];
        std::iter::zip(0.., columns).for_each(|(k, &column)| of_column[column as usize] = k);
        Self { of_column, count: columns.len() }
    }

    fn add(&self, row: &mut [f64], known: &Row, factor: f64) {
        known.iter().for_each(|&(column, value)| row[self.of_column[column as usize] as usize] += factor * value);
    }
}
