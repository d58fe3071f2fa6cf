//! What building a tree takes of the host's memory, asked before it is built.

use kdray::{
    engine::choices::TreeKind,
    util::memory::{OutOfMemory, require},
};

/// Bytes a triangle that building takes at its peak beside the triangles, measured on a sphere and a torus knot of a
/// million triangles.
const BYTES_OF_FAST_BUILD: u64 = 140;
const BYTES_OF_BEST_BUILD: u64 = 240;

/// Refuses a tree that does not fit in memory, before it is built.
pub fn check_memory(tree: TreeKind, n_triangles: usize) -> Result<(), OutOfMemory> {
    let bytes = match tree {
        TreeKind::Fast => BYTES_OF_FAST_BUILD,
        TreeKind::Best => BYTES_OF_BEST_BUILD,
    };
    require(&format!("building the kd-tree of {n_triangles} triangles"), n_triangles as u64 * bytes)
}
