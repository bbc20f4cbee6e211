//! How long the stages of a frame take.

use std::time::Instant;

/// Times of the stages, by name, in the order they first ran.
#[derive(Default)]
pub(super) struct Clock(pub(super) Vec<(&'static str, f64)>);

impl Clock {
    pub(super) fn time<T>(&mut self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        match self.0.iter_mut().find(|(name, _)| *name == stage) {
            Some((_, sum)) => *sum += ms,
            None => self.0.push((stage, ms)),
        }
        result
    }
}
