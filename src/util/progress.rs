//! Progress of long work, which the library reports and a program shows.

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

/// Work whose progress is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Work {
    /// A mesh file is read; its bytes count.
    Reading,
    /// Images are decoded; their number counts.
    Images,
    /// An acceleration structure is built; its triangles count.
    Building,
}

/// Receives reports of progress, from any thread.
pub trait Observer: Send + Sync {
    /// `share` of the work is done, 0 to 1. Work of one kind can begin several times, for example with each file.
    fn progress(&self, work: Work, share: f32);
}

/// The observer of some work, or none. Without an observer, reports cost nothing.
#[derive(Clone, Default)]
pub struct Progress(Option<Arc<dyn Observer>>);

impl Progress {
    /// Reports progress to an observer.
    pub fn to(observer: Arc<dyn Observer>) -> Self {
        Self(Some(observer))
    }

    /// Reports that a share of some work is done, 0 to 1.
    pub fn report(&self, work: Work, share: f32) {
        if let Some(observer) = &self.0 {
            observer.progress(work, share);
        }
    }

    /// Begins work of `total` units.
    pub(crate) fn begin(&self, work: Work, total: u64) -> Meter<'_> {
        Meter { observer: self.0.as_deref(), work, done: AtomicU64::new(0), total }
    }
}

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Progress(observed)" } else { "Progress" })
    }
}

/// Two are equal if they have the same observer, or none.
impl PartialEq for Progress {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (None, None) => true,
            _ => false,
        }
    }
}

/// Counts units of work that is under way.
pub(crate) struct Meter<'a> {
    observer: Option<&'a dyn Observer>,
    work: Work,
    done: AtomicU64,
    total: u64,
}

impl Meter<'_> {
    /// Reports that `n` more units are done.
    pub fn add(&self, n: u64) {
        let Some(observer) = self.observer else { return };
        let done = self.done.fetch_add(n, Ordering::Relaxed) + n;
        observer.progress(self.work, (done as f64 / self.total.max(1) as f64).min(1.0) as f32);
    }
}
