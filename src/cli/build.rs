//! What building an acceleration structure takes of the host's memory, asked before it is built.

use kdray::{
    engine::choices::{ChosenAccel, TreeKind},
    util::memory::{OutOfMemory, require},
};

/// Bytes a triangle that building takes at its peak beside the triangles, measured on a sphere and a torus knot of a
/// million triangles.
const BYTES_OF_FAST_BUILD: u64 = 140;
const BYTES_OF_BEST_BUILD: u64 = 240;
const BYTES_OF_GRID_BUILD: u64 = 240;

/// Refuses a structure that does not fit in memory, before it is built.
pub fn check_memory(accel: ChosenAccel, n_triangles: usize) -> Result<(), OutOfMemory> {
    let bytes = match accel.tree_kind().map(|chosen| chosen.value) {
        Some(TreeKind::Fast) => BYTES_OF_FAST_BUILD,
        Some(TreeKind::Best) => BYTES_OF_BEST_BUILD,
        None => BYTES_OF_GRID_BUILD,
    };
    require(&building(accel, n_triangles), n_triangles as u64 * bytes)
}

/// What is being done while a structure is built.
pub fn building(accel: ChosenAccel, n_triangles: usize) -> String {
    format!("building the {} of {n_triangles} triangles", accel.kind().name())
}
