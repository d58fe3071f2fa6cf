//! Progress of long work, which the library reports and a program shows.

use std::{
    fmt, mem,
    sync::{
        Arc, Mutex, PoisonError,
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
    /// `share` of the work is done, 0 to 1. Work of one kind can begin several times, for example with each file. An
    /// observer that unwinds ends the work.
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

    /// Returns what reports of subtasks go to. A subtask counts by its size.
    pub(crate) fn subtasks(&self, sizes: impl Iterator<Item = u32>) -> Vec<Self> {
        let Some(observer) = &self.0 else { return sizes.map(|_| Self::default()).collect() };
        let sizes: Vec<u32> = sizes.collect();
        let total = sizes.iter().map(|size| f64::from(*size)).sum::<f64>().max(1.0);
        let done = Arc::new(Mutex::new(0.0));
        let subtask = |size: u32| {
            let (observer, done) = (Arc::clone(observer), Arc::clone(&done));
            Self::to(Arc::new(Subtask { observer, weight: f64::from(size) / total, done, told: Mutex::new(0.0) }))
        };
        sizes.into_iter().map(subtask).collect()
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

/// The observer of a subtask.
struct Subtask {
    /// That of the whole work.
    observer: Arc<dyn Observer>,
    weight: f64,
    /// The share of the whole work that is done.
    done: Arc<Mutex<f64>>,
    /// The share of the subtask that is done.
    told: Mutex<f32>,
}

impl Observer for Subtask {
    fn progress(&self, work: Work, share: f32) {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let greater = told.max(share);
        let more = greater - mem::replace(&mut *told, greater);
        let mut done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        *done += self.weight * f64::from(more);
        let share = done.min(1.0) as f32;
        drop((told, done));
        self.observer.progress(work, share);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Shares(Mutex<Vec<f32>>);

    impl Observer for Shares {
        fn progress(&self, _: Work, share: f32) {
            self.0.lock().unwrap().push(share);
        }
    }

    #[test]
    fn subtasks_count_by_their_sizes() {
        let shares = Arc::new(Shares::default());
        let progress = Progress::to(Arc::clone(&shares) as Arc<dyn Observer>);
        let subtasks = progress.subtasks([3, 0, 1].into_iter());
        for (subtask, share) in [(2, 1.0), (0, 0.5), (1, 1.0), (0, 0.25), (0, 1.0)] {
            subtasks[subtask].report(Work::Building, share);
        }
        assert_eq!(*shares.0.lock().unwrap(), [0.25, 0.625, 0.625, 0.625, 1.0]);
        assert!(Progress::default().subtasks([1].into_iter())[0] == Progress::default());
    }
}
