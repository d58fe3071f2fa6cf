//! The time in which a scene has to be drawn.

use std::{
    panic::{self, AssertUnwindSafe},
    sync::mpsc,
    time::{Duration, Instant},
};

use rayon::ThreadPoolBuilder;

use crate::cli::error::CliError;

/// Size of the stacks of threads that load and build: that of a main thread, which does it otherwise.
const STACK_BYTES: usize = 8 << 20;

/// The end of the time of a scene, if it has one.
#[derive(Clone, Copy)]
pub struct Deadline {
    begun_at: Instant,
    limit: Option<Duration>,
}

impl Deadline {
    /// Starts the clock.
    pub fn new(limit: Option<Duration>) -> Self {
        Self { begun_at: Instant::now(), limit }
    }

    /// Returns the limit if the time is over.
    pub fn passed(&self) -> Option<Duration> {
        self.limit.filter(|limit| self.begun_at.elapsed() >= *limit)
    }

    /// Refuses to go on if the time is over. `present`: what has been done.
    pub fn check(&self, present: &'static str) -> Result<(), CliError> {
        self.passed().map_or(Ok(()), |limit| Err(CliError::TimeLimit { limit, present }))
    }

    /// Does work, but waits for it only until the time is over. Since nothing can stop it from outside, the work then
    /// goes on, and its result is dropped. It has a thread pool of its own: on the pool of all, the next scene would
    /// wait until all of its tasks are done. `present`: what the work is.
    ///
    /// # Errors
    /// The time is over, or the system has no threads.
    pub fn within<T: Send + 'static>(
        &self,
        present: &'static str,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, CliError> {
        let Some(limit) = self.limit else { return Ok(work()) };
        let n_threads = rayon::current_num_threads();
        let pool = ThreadPoolBuilder::new().num_threads(n_threads).stack_size(STACK_BYTES).build();
        let pool = pool.map_err(|error| CliError::Usage(format!("--time-limit: {error}")))?;
        let (send, receive) = mpsc::channel();
        // Sending fails if nobody waits any more.
        pool.spawn(move || drop(send.send(panic::catch_unwind(AssertUnwindSafe(work)))));
        match receive.recv_timeout(limit.saturating_sub(self.begun_at.elapsed())) {
            Ok(result) => Ok(result.unwrap_or_else(|panic| panic::resume_unwind(panic))),
            Err(_) => Err(CliError::TimeLimit { limit, present }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_waited_for_until_the_time_is_over() {
        let within = |limit, work: fn() -> u32| Deadline::new(limit).within("loading", work);
        assert_eq!(within(None, || 7).unwrap(), 7);
        assert_eq!(within(Some(Duration::from_secs(600)), || 7).unwrap(), 7);
        let for_ever = || loop {
            std::thread::park();
        };
        let error = within(Some(Duration::from_millis(5)), for_ever).unwrap_err();
        assert_eq!(
            (error.exit_code(), error.to_string().contains("--time-limit 5ms: it was still loading")),
            (3, true)
        );
    }
}
