//! faer's left-looking supernodal Cholesky under approximate minimum degree: for graphs that are no surface, and the oracle.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::solvers::LltError;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal::SupernodalLltRef,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use crate::fronts::buffer::Buffer;
use crate::substitute::solution::{Part, RightHandSides, Solution};
use crate::{Failure, NotPositive, SymmetricMatrix, pivot_floor};

/// A factorisation by supernodes.
#[derive(Debug)]
pub(crate) struct Supernodal {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

/// Matrices smaller than this are factored before anybody could want to stop.
const QUICK: usize = 2000;
/// How often a request to stop is looked at.
const LOOK: Duration = Duration::from_millis(20);

impl Supernodal {
    /// The same as [`Self::factor`], unless `stop` is set meanwhile. faer has no way to stop, so a thread of its own does the
    /// work and, once nobody waits for it any more, ends it in the background.
    pub(crate) fn factor_until(matrix: &Arc<SymmetricMatrix>, stop: &AtomicBool) -> Result<Self, Failure> {
        if matrix.size() < QUICK {
            return Self::factor(matrix).map_err(Failure::NotPositive);
        }
        let (sender, receiver) = channel();
        let matrix = Arc::clone(matrix);
        let worker = std::thread::spawn(move || drop(sender.send(Self::factor(&matrix))));
        loop {
            match receiver.recv_timeout(LOOK) {
                Ok(outcome) => return outcome.map_err(Failure::NotPositive),
                Err(RecvTimeoutError::Timeout) if stop.load(Ordering::Relaxed) => return Err(Failure::Stopped),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => match worker.join() {
                    Err(panic) => std::panic::resume_unwind(panic),
                    Ok(()) => unreachable!("it sends before it ends"),
                },
            }
        }
    }

    /// Orders, analyses and factors `matrix`, which must not be empty.
    pub(crate) fn factor(matrix: &SymmetricMatrix) -> Result<Self, NotPositive> {
        let n = matrix.size();
        let rows: Vec<usize> = matrix.rows.iter().map(|&i| i as usize).collect();
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &matrix.column_starts, None, &rows);
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Lower, SymmetricOrdering::Amd, params)
            .expect("indices of 64 bits do not overflow");
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let outcome = symbolic.factorize_numeric_llt(
            &mut values,
            SparseColMatRef::new(pattern, matrix.values.as_slice()),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        );
        if let Err(LltError::NonPositivePivot { index }) = outcome {
            return Err(NotPositive { unknown: unknown_at(&symbolic, index) });
        }
        check_pivots(matrix, &symbolic, &values)?;
        Ok(Self { symbolic, values })
    }

    /// Solves for all columns.
    pub(crate) fn solve(&self, rhs: &RightHandSides) -> Solution<'_> {
        let (n, columns) = (rhs.size(), rhs.columns);
        let mut values = Buffer::zeroed(n * columns);
        for (i, x) in values.chunks_exact_mut(columns).enumerate() {
            rhs.row(i).into_iter().for_each(|row| x.copy_from_slice(row));
        }
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_row_major_slice_mut(&mut values, n, columns),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        Solution { place: None, parts: vec![Part { values, width: columns, count: columns }], residual: 0.0 }
    }

    /// Number of stored entries of the factor.
    pub(crate) fn stored(&self) -> usize {
        self.values.len()
    }
}

/// The unknown that is eliminated at place `index`.
fn unknown_at(symbolic: &SymbolicCholesky<usize>, index: usize) -> usize {
    symbolic.perm().map_or(index, |order| order.arrays().0[index])
}

/// Refuses pivots that rounding alone made positive.
fn check_pivots(
    matrix: &SymmetricMatrix,
    symbolic: &SymbolicCholesky<usize>,
    values: &[f64],
) -> Result<(), NotPositive> {
    let SymbolicCholeskyRaw::Supernodal(supernodes) = symbolic.raw() else { return Ok(()) };
    let factor = SupernodalLltRef::new(supernodes, values);
    for s in 0..supernodes.n_supernodes() {
        let block = factor.supernode(s);
        for j in 0..block.val().ncols() {
            let unknown = unknown_at(symbolic, block.start() + j);
            let pivot = block.val()[(j, j)].powi(2);
            if pivot.is_nan() || pivot <= pivot_floor(matrix.diagonal(unknown)) {
                return Err(NotPositive { unknown });
            }
        }
    }
    Ok(())
}
