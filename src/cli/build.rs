//! The host memory that building an acceleration structure takes, checked before it is built.

use kdray::{
    engine::choices::{ChosenAccel, TreeKind},
    util::memory::{OutOfMemory, require},
};

// Peak memory of a build in bytes per triangle, without the triangles themselves. Measured on a sphere and a torus
// knot of a million triangles.
const BYTES_OF_FAST_BUILD: u64 = 140;
const BYTES_OF_BEST_BUILD: u64 = 240;
const BYTES_OF_GRID_BUILD: u64 = 240;

/// Refuses a structure whose build does not fit in memory.
pub fn check_memory(accel: ChosenAccel, n_triangles: usize) -> Result<(), OutOfMemory> {
    let bytes = match accel.tree_kind().map(|chosen| chosen.value) {
        Some(TreeKind::Fast) => BYTES_OF_FAST_BUILD,
        Some(TreeKind::Best) => BYTES_OF_BEST_BUILD,
        None => BYTES_OF_GRID_BUILD,
    };
    require(&building(accel, n_triangles), n_triangles as u64 * bytes)
}

/// Returns the name of the stage that builds a structure, for progress and error messages.
pub fn building(accel: ChosenAccel, n_triangles: usize) -> String {
    format!("building the {} of {n_triangles} triangles", accel.kind().name())
}
