//! Values that are made when they are first needed.

use std::sync::OnceLock;

/// Returns the cell's value, computed by `make` if the cell is empty. Does not block: `OnceLock::get_or_init` could
/// deadlock when rayon steals a task that initializes the same cell. Two threads may compute the value; the first
/// result is kept.
pub fn made_once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    if let Some(made) = cell.get() {
        return made;
    }
    let made = make();
    cell.get_or_init(|| made)
}
