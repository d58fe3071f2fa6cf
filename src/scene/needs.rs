//! How much memory a scene takes, asked for before it is allocated.

use std::{fs, path::Path};

use super::error::Checked;
use crate::util::memory::require;

/// Bytes of a loaded triangle: its corners and normals, and the index of its material.
const TRIANGLE_BYTES: u64 = 52;
/// Bytes a triangle that building the tree takes at its peak beside the triangles, at least. A million triangles of a
/// sphere or a torus knot take 0.20 GB in all with `--build fast`, and 0.30 to 0.33 GB with `--build best`.
const TREE_BYTES: u64 = 140;
/// Copies of a text file that there are while it is checked: the file itself, and what is rewritten of it for the
/// parser.
const TEXT_COPIES: u64 = 2;

/// Refuses triangles beyond those that are loaded if there is no memory for them and for the tree over all.
pub(super) fn require_for_triangles(n_loaded: u64, n_more: u64) -> Checked<()> {
    let needed = n_more * TRIANGLE_BYTES + (n_loaded + n_more) * TREE_BYTES;
    require(&format!("a scene of {} triangles", n_loaded + n_more), needed).map_err(|error| error.to_string())
}

/// Refuses a text file that is too large to be read. A file that cannot be read is left to the reader to refuse.
pub(super) fn require_for_text(path: &Path) -> Checked<()> {
    let n_bytes = fs::metadata(path).map_or(0, |metadata| metadata.len());
    require("reading it", n_bytes.saturating_mul(TEXT_COPIES)).map_err(|error| error.to_string())
}
