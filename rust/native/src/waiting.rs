//! Waiting for a thread that works, with a look at signals now and then.

use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::time::Duration;

use pyo3::prelude::*;
use skinwright_core::Progress;

/// How often signals are looked at.
const LOOK: Duration = Duration::from_millis(50);

/// Tells that work has ended, in whatever way.
pub struct End(Mutex<Receiver<()>>);

/// What the working thread drops at its end, and the end that others wait for.
pub fn end() -> (Sender<()>, End) {
    let (running, ended) = channel();
    (running, End(Mutex::new(ended)))
}

impl End {
    /// Waits at most so long, with the GIL freed; returns whether the work has ended.
    pub fn within(&self, py: Python<'_>, time: Duration) -> bool {
        py.detach(|| self.0.lock().expect("never poisoned").recv_timeout(time) != Err(RecvTimeoutError::Timeout))
    }

    /// Whether the work has ended; no, while another thread waits for that.
    pub fn has_come(&self) -> bool {
        self.0.try_lock().is_ok_and(|ended| ended.try_recv() == Err(TryRecvError::Disconnected))
    }

    /// Waits for the end. The exception that a signal has raised cancels the work and is returned.
    pub fn watched(&self, py: Python<'_>, progress: &Progress) -> Option<PyErr> {
        let mut interrupt = None;
        while !self.within(py, LOOK) {
            if let Err(signal) = py.check_signals() {
                progress.cancel();
                interrupt = Some(signal);
            }
        }
        interrupt
    }
}
