//! The one table from the core's errors to Python exceptions, and the one door that frees the GIL.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::thread::Builder;

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use skinwright_core::{Error, Progress};

use crate::waiting;

create_exception!(skinwright_native, SkinwrightError, PyValueError, "Base of every error of this module.");
create_exception!(skinwright_native, NothingMatched, SkinwrightError, "No target vertex matches the source.");
create_exception!(skinwright_native, InvalidMesh, SkinwrightError, "A mesh that cannot be used.");
create_exception!(skinwright_native, InvalidWeights, SkinwrightError, "Weights that cannot be used.");
create_exception!(
    skinwright_native,
    InvalidParameter,
    SkinwrightError,
    "A parameter out of range or of the wrong shape."
);
create_exception!(skinwright_native, NotSolvable, SkinwrightError, "A system without a reliable solution.");
create_exception!(skinwright_native, Cancelled, SkinwrightError, "The work was cancelled; nothing was changed.");

/// The table.
pub fn to_python(error: Error) -> PyErr {
    let sentence = error.to_string();
    match error {
        Error::NothingMatched { .. } => NothingMatched::new_err(sentence),
        Error::NoTriangles { .. }
        | Error::PositionNotFinite { .. }
        | Error::VertexOutOfRange { .. }
        | Error::EdgeOutOfRange { .. }
        | Error::NothingInside
        | Error::TooManyVertices { .. } => InvalidMesh::new_err(sentence),
        Error::WeightNotFinite { .. } | Error::WeightNegative { .. } | Error::InvalidWeights { .. } => {
            InvalidWeights::new_err(sentence)
        }
        Error::LengthMismatch { .. }
        | Error::InvalidParameter { .. }
        | Error::InvalidSkeleton { .. }
        | Error::UnusableBone { .. }
        | Error::NoCommonBones => InvalidParameter::new_err(sentence),
        Error::NotPositiveDefinite { .. } => NotSolvable::new_err(sentence),
        Error::Cancelled => Cancelled::new_err(sentence),
    }
}

/// What work on the core's side comes to: its own result, or the message of a panic, which is a bug.
pub type Outcome<T> = Result<skinwright_core::Result<T>, String>;

/// The process that has the threads shared by all work. A child made by `fork` has none of them: it would wait for ever.
static OWNER: OnceLock<u32> = OnceLock::new();

/// Whether the threads that this module has started are those of another process.
pub fn is_forked() -> bool {
    *OWNER.get_or_init(std::process::id) != std::process::id()
}

/// Runs `work` on `threads` threads (0: all of the machine's) and catches panics.
pub fn run<T: Send>(threads: usize, work: impl FnOnce() -> skinwright_core::Result<T> + Send) -> Outcome<T> {
    let work = || match threads {
        0 if !is_forked() => Ok(work()),
        n => {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build();
            pool.map(|pool| pool.install(work)).map_err(|error| format!("no {n} threads can be started: {error}"))
        }
    };
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
        Err(format!("internal error in Skinwright, please report it: {}", text.unwrap_or("unknown panic")))
    })
}

/// Maps an outcome to Python.
pub fn finish<T>(outcome: Outcome<T>) -> PyResult<T> {
    outcome.map_err(PyRuntimeError::new_err)?.map_err(to_python)
}

/// The door: frees the GIL, runs `work`, maps what comes back.
pub fn enter<T: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce() -> skinwright_core::Result<T> + Send,
) -> PyResult<T> {
    finish(py.detach(|| run(threads, work)))
}

/// The door of work that may take long: Ctrl C stops it and is raised.
pub fn enter_stoppable<T: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce(&Progress) -> skinwright_core::Result<T> + Send,
) -> PyResult<T> {
    let progress = &Progress::default();
    let (running, ended) = waiting::end();
    let work = move || {
        let _running = running;
        run(threads, || work(progress))
    };
    let (outcome, interrupt) = std::thread::scope(|scope| {
        let worker = match Builder::new().spawn_scoped(scope, work) {
            Ok(worker) => worker,
            Err(error) => return (Err(format!("no thread can be started: {error}")), None),
        };
        let interrupt = ended.watched(py, progress);
        (py.detach(|| worker.join()).unwrap_or_else(|_| Err("the work's thread was lost".into())), interrupt)
    });
    interrupt.map_or_else(|| finish(outcome), Err)
}
