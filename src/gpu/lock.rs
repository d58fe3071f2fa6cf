//! Locks with ranks. A thread may take only locks of a higher rank than those that it holds, so no two threads can
//! wait for each other. A wrong order panics wherever it happens, whether or not another thread waits.

use std::{
    cell::Cell,
    ops::{Deref, DerefMut},
    sync::{Mutex, MutexGuard, PoisonError},
};

use super::GpuError;

/// What a lock protects, in the order in which locks may be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rank {
    /// Layouts of descriptor sets and pipelines.
    Layouts,
    /// Compute pipelines.
    Pipelines,
    /// Shaders that replace those of the program.
    #[cfg(feature = "view")]
    Replacements,
    /// Command pools that are not in use.
    Pools,
    /// The queue, and what it works on.
    Queue,
    /// The queue of a device that the library's caller owns.
    ExternalQueue,
    /// The allocator of the device's memory.
    Allocator,
    /// Rows of a timer.
    Timer,
    /// Messages of the validation layer, which come from within Vulkan calls.
    Messages,
}

thread_local! {
    /// The ranks of the locks that the thread holds, a bit each.
    static HELD: Cell<u32> = const { Cell::new(0) };
}

/// A lock that is held.
pub(super) struct Guard<'a, T> {
    guard: MutexGuard<'a, T>,
    rank: Rank,
}

/// Takes a lock.
///
/// # Errors
/// A thread has panicked while it held the lock, so what the lock protects may be incomplete.
///
/// # Panics
/// The thread holds a lock of the same or a higher rank.
pub(super) fn lock<T>(rank: Rank, mutex: &Mutex<T>) -> Result<Guard<'_, T>, GpuError> {
    enter(rank);
    match mutex.lock() {
        Ok(guard) => Ok(Guard { guard, rank }),
        Err(_) => {
            leave(rank);
            Err(GpuError::Panicked(format!("{rank:?}")))
        }
    }
}

/// Takes a lock whose content is always complete, whoever has panicked.
///
/// # Panics
/// The thread holds a lock of the same or a higher rank.
pub(super) fn lock_anyway<T>(rank: Rank, mutex: &Mutex<T>) -> Guard<'_, T> {
    enter(rank);
    Guard { guard: mutex.lock().unwrap_or_else(PoisonError::into_inner), rank }
}

fn enter(rank: Rank) {
    let held = HELD.get();
    assert!(held >> rank as u32 == 0, "the lock of {rank:?} is taken after one of its own or a higher rank");
    HELD.set(held | 1 << rank as u32);
}

fn leave(rank: Rank) {
    HELD.set(HELD.get() & !(1 << rank as u32));
}

impl<T> Drop for Guard<'_, T> {
    fn drop(&mut self) {
        leave(self.rank);
    }
}

impl<T> Deref for Guard<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.guard
    }
}

impl<T> DerefMut for Guard<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.guard
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    #[test]
    fn a_wrong_order_panics() {
        let (queue, allocator) = (Mutex::new(1), Mutex::new(2));
        {
            let first = lock(Rank::Queue, &queue).unwrap();
            let second = lock(Rank::Allocator, &allocator).unwrap();
            assert_eq!((*first, *second), (1, 2));
        }
        let wrong = |first, second| {
            catch_unwind(AssertUnwindSafe(|| {
                let _held = lock_anyway(first, &allocator);
                let _also = lock_anyway(second, &queue);
            }))
        };
        assert!(wrong(Rank::Allocator, Rank::Queue).is_err());
        assert!(wrong(Rank::Queue, Rank::Queue).is_err(), "the thread would wait for itself");
        assert!(wrong(Rank::Queue, Rank::Allocator).is_ok(), "a panic leaves no rank behind");
    }

    #[test]
    fn a_panic_of_another_thread_is_an_error() {
        let mutex = Mutex::new(0);
        let panicked = std::thread::scope(|scope| {
            let panics = || {
                let _held = lock(Rank::Queue, &mutex).unwrap();
                panic!("while the lock is held");
            };
            scope.spawn(panics).join()
        });
        assert!(panicked.is_err());
        assert!(matches!(lock(Rank::Queue, &mutex), Err(GpuError::Panicked(_))));
        assert_eq!(*lock_anyway(Rank::Queue, &mutex), 0, "an error leaves no rank behind");
    }
}
