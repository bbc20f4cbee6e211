//! Work on Rust's own threads, watched from Python.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use skinwright_core::Progress;

use crate::error::{Outcome, SkinwrightError, finish, is_forked, run};
use crate::waiting::{self, End};

/// In seconds; more would be another name for ever.
const LONGEST_WAIT: f64 = 3600.0;

/// Turns what the core returned into what Python gets.
type Present = Box<dyn FnOnce(Python<'_>) -> PyResult<Py<PyAny>> + Send>;

/// Work going on on Rust's own threads; poll it from a timer.
#[pyclass(frozen, module = "skinwright_native")]
pub struct Job {
    progress: Arc<Progress>,
    thread: Mutex<Option<JoinHandle<Outcome<Present>>>>,
    end: End,
    /// Held by whoever waits for the thread: others wait behind them.
    turn: Mutex<()>,
    result: OnceLock<PyResult<Py<PyAny>>>,
}

impl Job {
    /// Starts `work` on a thread of its own; inside, rayon runs on `threads` threads (0: all). `present` turns its result into a
    /// Python object once somebody asks for it.
    pub fn start<T: Send + 'static>(
        threads: usize,
        work: impl FnOnce(&Progress) -> skinwright_core::Result<T> + Send + 'static,
        present: impl FnOnce(Python<'_>, T) -> PyResult<Py<PyAny>> + Send + 'static,
    ) -> PyResult<Self> {
        let progress = Arc::new(Progress::default());
        let seen = Arc::clone(&progress);
        let presented = move |seen: &Progress| {
            let result = work(seen)?;
            Ok(Box::new(move |py: Python<'_>| present(py, result)) as Present)
        };
        let (running, end) = waiting::end();
        let thread = std::thread::Builder::new().spawn(move || {
            let _running = running;
            run(threads, move || presented(&seen))
        });
        let thread = thread.map_err(|error| SkinwrightError::new_err(format!("no thread can be started: {error}")))?;
        Ok(Self { progress, thread: Mutex::new(Some(thread)), end, turn: Mutex::new(()), result: OnceLock::new() })
    }

    fn outcome(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        expect_own_process()?;
        let thread = self.thread.lock().expect("never poisoned").take();
        let Some(thread) = thread else { return Err(SkinwrightError::new_err("this job was interrupted")) };
        if let Some(interrupt) = self.end.watched(py, &self.progress) {
            return Err(interrupt);
        }
        let outcome = py.detach(|| thread.join()).unwrap_or_else(|_| Err("the job's thread was lost".into()));
        finish(outcome)?(py)
    }
}

fn expect_own_process() -> PyResult<()> {
    let refusal = || SkinwrightError::new_err("this job runs in the process that started it: wait for it there");
    if is_forked() { Err(refusal()) } else { Ok(()) }
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
        self.result.get().is_some() || self.end.has_come()
    }

    /// Asks the work to stop; `result()` then raises `Cancelled` unless it had finished already.
    fn cancel(&self) {
        self.progress.cancel();
    }

    /// Waits at most so many seconds for the work's end; returns whether it has come.
    fn wait(&self, py: Python<'_>, seconds: f64) -> PyResult<bool> {
        expect_own_process()?;
        let time = Duration::try_from_secs_f64(seconds.clamp(0.0, LONGEST_WAIT)).unwrap_or_default();
        Ok(self.end.within(py, time))
    }

    /// Waits for the work and returns what it gave, or raises its error. May be called again, and from several threads.
    fn result(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let turn = self.turn.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner);
        if self.result.get().is_none() {
            let result = self.outcome(py);
            let _ = self.result.set(result);
        }
        drop(turn);
        match self.result.get().expect("just set") {
            Ok(result) => Ok(result.clone_ref(py)),
            Err(error) => Err(error.clone_ref(py)),
        }
    }
}

/// Two Python functions with one list of arguments, written once: `$call` waits for the result, `$start` returns a [`Job`].
///
/// The arguments are those of a `#[pyfunction]` without `py`, in the signature's order and with `threads` among them. The block
/// makes the owned inputs; their `run` is the work, and the module's `present` wraps what it returns.
macro_rules! call_and_job {
    (
        $(#[$call_attribute:meta])*
        $call:ident -> $returns:ty,
        $(#[$start_attribute:meta])*
        $start:ident,
        signature = $signature:tt,
        |$py:ident, $threads:ident, $($(#[$($attribute:tt)*])* $name:ident: $kind:ty),+ $(,)?| $inputs:block
    ) => {
        $(#[$call_attribute])*
        #[pyfunction]
        #[pyo3(signature = $signature)]
        #[expect(clippy::too_many_arguments, reason = "the arguments of the Python function")]
        pub fn $call($py: Python<'_>, $($(#[$($attribute)*])* $name: $kind),+) -> PyResult<$returns> {
            let inputs = $inputs;
            let result = crate::error::enter_stoppable($py, $threads, |progress| inputs.run(progress))?;
            present($py, result)
        }

        $(#[$start_attribute])*
        #[pyfunction]
        #[pyo3(signature = $signature)]
        #[expect(clippy::too_many_arguments, reason = "the arguments of the Python function")]
        pub fn $start($py: Python<'_>, $($(#[$($attribute)*])* $name: $kind),+) -> PyResult<crate::job::Job> {
            let _ = $py; // Not every operation needs it for its inputs.
            let inputs = $inputs;
            let present = |py: Python<'_>, result| Ok(Py::new(py, present(py, result)?)?.into_any());
            crate::job::Job::start($threads, move |progress: &Progress| inputs.run(progress), present)
        }
    };
}
pub(crate) use call_and_job;
