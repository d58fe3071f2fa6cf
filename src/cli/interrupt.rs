//! What the first Ctrl-C does while `kdray render` has a picture that is not written yet: the picture is written with
//! the samples so far, and then the process ends. A second Ctrl-C ends it at once, and so does the first one at any
//! other time.
//!
//! One lock guards both the number of such pictures and the user's wish. So whoever has an [`Unwritten`] before the
//! signal arrives can write its picture.

use std::sync::{Mutex, MutexGuard, PoisonError};

struct State {
    /// Number of [`Unwritten`]s.
    n_unwritten: usize,
    /// Whether the process ends when these pictures are written.
    is_asked: bool,
}

static STATE: Mutex<State> = Mutex::new(State { n_unwritten: 0, is_asked: false });

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Stands for a picture that has complete samples and is not written yet.
pub struct Unwritten(());

impl Default for Unwritten {
    fn default() -> Self {
        state().n_unwritten += 1;
        Self(())
    }
}

impl Drop for Unwritten {
    fn drop(&mut self) {
        state().n_unwritten -= 1;
    }
}

/// Takes note of Ctrl-C. Returns whether the process has a picture to write before it ends.
#[cfg(unix)]
pub fn ask() -> bool {
    let mut state = state();
    let waits = state.n_unwritten > 0 && !state.is_asked;
    state.is_asked |= waits;
    waits
}

/// Whether the user wants the process to end after the present picture.
pub fn is_asked() -> bool {
    state().is_asked
}

/// Ends the process if the user wants that and all pictures are written.
pub fn end_if_asked() {
    let State { n_unwritten, is_asked } = *state();
    if is_asked && n_unwritten == 0 {
        #[cfg(unix)]
        super::signals::end_by_interrupt();
    }
}
