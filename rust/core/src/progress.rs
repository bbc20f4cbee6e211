//! Progress out of, and a cancel request into, work that runs on other threads.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use crate::error::{Error, Result};

/// A shared counter from 0 to 1 and a flag. Every long loop reports to one and asks it whether to go on.
#[derive(Debug, Default)]
pub struct Progress {
    permille: AtomicU32,
    cancelled: AtomicBool,
}

impl Progress {
    /// Says how much of the work is done, 0 to 1. Never goes back.
    pub fn report(&self, fraction: f64) {
        self.permille.fetch_max((fraction.clamp(0.0, 1.0) * 1000.0) as u32, Ordering::Relaxed);
    }

    /// The share of the work done so far, 0 to 1.
    pub fn fraction(&self) -> f64 {
        f64::from(self.permille.load(Ordering::Relaxed)) / 1000.0
    }

    /// Asks the work to stop at its next check.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Set once [`Progress::cancel`] was called.
    pub(crate) fn stop(&self) -> &AtomicBool {
        &self.cancelled
    }

    /// `Err(Cancelled)` once [`Progress::cancel`] was called.
    pub fn check(&self) -> Result<()> {
        if self.cancelled.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }
}
