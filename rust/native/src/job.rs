//! Work on Rust's own threads, watched from Python.

use std::sync::{Arc, Mutex, OnceLock};
use std::thread::JoinHandle;

use pyo3::prelude::*;
use skinwright_core::Progress;

use crate::error::{Outcome, SkinwrightError, finish, run};
use crate::transfer::Transfer;

type TransferOutcome = Outcome<skinwright_core::transfer::Transfer>;

/// Work going on on Rust's own threads; poll it from a timer.
#[pyclass(frozen, module = "skinwright_native")]
pub struct Job {
    progress: Arc<Progress>,
    thread: Mutex<Option<JoinHandle<TransferOutcome>>>,
    result: OnceLock<PyResult<Py<Transfer>>>,
}

impl Job {
    /// Starts `work` on a thread of its own; inside, rayon runs on `threads` threads (0: all).
    pub fn start(
        threads: usize,
        work: impl FnOnce(&Progress) -> skinwright_core::Result<skinwright_core::transfer::Transfer> + Send + 'static,
    ) -> PyResult<Self> {
        let progress = Arc::new(Progress::default());
        let seen = Arc::clone(&progress);
        let thread = std::thread::Builder::new().spawn(move || run(threads, move || work(&seen)));
        let thread = thread.map_err(|error| SkinwrightError::new_err(format!("no thread can be started: {error}")))?;
        Ok(Self { progress, thread: Mutex::new(Some(thread)), result: OnceLock::new() })
    }

    fn wait(&self, py: Python<'_>) -> PyResult<Py<Transfer>> {
        let thread = self.thread.lock().expect("never poisoned").take();
        let Some(thread) = thread else {
            return Err(SkinwrightError::new_err("another thread is waiting for this job"));
        };
        let outcome = py.detach(|| thread.join()).unwrap_or_else(|_| Err("the job's thread was lost".into()));
        Py::new(py, Transfer::of(py, finish(outcome)?)?)
    }
}

#[pymethods]
impl Job {
    /// Share of the work done, 0 to 1.
    #[getter]
    fn progress(&self) -> f64 {
        self.progress.fraction()
    }

    /// Whether `result()` returns at once.
    #[getter]
    fn done(&self) -> bool {
        self.result.get().is_some()
            || self.thread.lock().expect("never poisoned").as_ref().is_some_and(JoinHandle::is_finished)
    }

    /// Asks the work to stop; `result()` then raises `Cancelled` unless it had finished already.
    fn cancel(&self) {
        self.progress.cancel();
    }

    /// Waits for the work and returns what it gave, or raises its error. May be called again.
    fn result(&self, py: Python<'_>) -> PyResult<Py<Transfer>> {
        if self.result.get().is_none() {
            let result = self.wait(py);
            let _ = self.result.set(result);
        }
        match self.result.get().expect("just set") {
            Ok(transfer) => Ok(transfer.clone_ref(py)),
            Err(error) => Err(error.clone_ref(py)),
        }
    }
}
