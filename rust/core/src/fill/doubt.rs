//! What becomes of a solution that is in doubt.

use crate::error::Result;

/// Backward error of a solution, with all that was neglected, above which the factor is examined. That of values below
/// one counts relative to one, for what is neglected does not depend on them.
pub(super) const DOUBTFUL: f64 = 1e-4;

/// What `solve` finds. If its backward error is doubtful, what it finds once more, unless `examine` refuses the factor:
/// another one may have taken its place by then.
pub(super) fn solved_with_care<T>(
    solve: impl Fn() -> Result<T>,
    residual: impl FnOnce(&T) -> f64,
    examine: impl FnOnce() -> Result<()>,
) -> Result<T> {
    let found = solve()?;
    if residual(&found) <= DOUBTFUL {
        return Ok(found);
    }
    examine()?;
    solve()
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::error::Error;

    const REFUSED: Error = Error::NotPositiveDefinite { vertex: 7 };

    /// The outcome of a solution with this backward error, and how often it was solved and looked into.
    fn outcome(residual: f64, examined: Result<()>) -> (Result<usize>, usize, usize) {
        let (solves, looks) = (Cell::new(0), Cell::new(0));
        let count = |counter: &Cell<usize>| {
            counter.set(counter.get() + 1);
            counter.get()
        };
        let examine = || {
            count(&looks);
            examined
        };
        let found = solved_with_care(|| Ok(count(&solves)), |_| residual, examine);
        (found, solves.get(), looks.get())
    }

    #[test]
    fn only_doubtful_solutions_are_looked_into_and_solved_again() {
        for accurate in [0.0, 1e-8, 1e-4] {
            assert_eq!(outcome(accurate, Err(REFUSED)), (Ok(1), 1, 0));
        }
        for doubtful in [1.01e-4, 1.0, f64::INFINITY, f64::NAN] {
            assert_eq!(outcome(doubtful, Ok(())), (Ok(2), 2, 1));
            assert_eq!(outcome(doubtful, Err(REFUSED)), (Err(REFUSED), 1, 1));
        }
    }
}
