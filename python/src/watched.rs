//! Builds that Python watches: it is told of their progress, and Ctrl-C ends them.

use std::{
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU32, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    time::Duration,
};

use kdray::util::progress::{Observer, Progress, Work};
use pyo3::prelude::*;
use rayon::ThreadPool;

/// Time between two looks at Ctrl-C.
const LOOK: Duration = Duration::from_millis(20);

/// What a build reports to, from any thread.
#[derive(Default)]
struct Watch {
    /// The bits of the share that is done.
    share: AtomicU32,
    stops: AtomicBool,
}

/// What a build that was stopped unwinds with.
struct Stopped;

impl Observer for Watch {
    fn progress(&self, _: Work, share: f32) {
        // The bits of floats from 0 on have the order of the floats.
        self.share.fetch_max(share.to_bits(), Ordering::Relaxed);
        if self.stops.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// Runs `build` on the pool. Meanwhile, the caller's own thread lets Python raise KeyboardInterrupt, and calls `tell`
/// with the share that is done, 0 to 1. If either fails, the build ends at its next report.
pub fn watched(
    pool: &ThreadPool,
    build: impl FnOnce(&Progress) -> PyResult<()> + Send,
    mut tell: impl FnMut(f32) -> PyResult<()>,
) -> PyResult<()> {
    let watch = Arc::new(Watch::default());
    let progress = Progress::to(Arc::clone(&watch) as Arc<dyn Observer>);
    let (sender, receiver) = mpsc::channel();
    pool.in_place_scope(|scope| {
        scope.spawn(move |_| {
            let built = catch_unwind(AssertUnwindSafe(|| build(&progress)));
            sender.send(built).expect("the receiver waits");
        });
        let mut told = Ok(());
        loop {
            if told.is_ok() {
                let share = f32::from_bits(watch.share.load(Ordering::Relaxed));
                told = Python::attach(|py| py.check_signals()).and_then(|()| tell(share));
                watch.stops.store(told.is_err(), Ordering::Relaxed);
            }
            match receiver.recv_timeout(LOOK) {
                Ok(Ok(built)) => return told.and(built),
                Ok(Err(panic)) if panic.is::<Stopped>() => return told,
                Ok(Err(panic)) => resume_unwind(panic),
                Err(RecvTimeoutError::Disconnected) => unreachable!("the build sends its result"),
                Err(RecvTimeoutError::Timeout) => (),
            }
        }
    })
}
