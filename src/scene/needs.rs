//! Estimates of the memory that a scene needs, checked before it is allocated.

use std::{cmp::Reverse, fs, path::Path};

use super::error::Checked;
use crate::util::memory::require;

/// Size of a loaded triangle in bytes: three indices of corners (12), three normals (36) and a slot (4).
const TRIANGLE_BYTES: u64 = 52;
/// Peak memory of building the tree in bytes per triangle, in addition to the triangles; a lower bound. A million
/// triangles of a sphere or a torus knot take 0.20 GB in all with `--build fast`, and 0.30 to 0.33 GB with
/// `--build best`.
const TREE_BYTES: u64 = 140;
/// Size of the tangents of a triangle in bytes.
const TANGENT_BYTES: u64 = 48;
/// Peak memory of MikkTSpace in bytes per triangle: what it notes of the triangle (160), its corners in a search tree
/// and in lists (150), edges (120), groups of corners (150) and tangents (120).
const MIKKTSPACE_BYTES: u64 = 700;
/// Copies of a text file in memory while it is checked: the file itself, and its statements rewritten for the parser.
const TEXT_COPIES: u64 = 2;

/// Refuses `n_more` triangles in addition to `n_loaded` if there is not enough memory for them and for the tree over
/// all triangles.
pub(super) fn require_for_triangles(n_loaded: u64, n_more: u64) -> Checked<()> {
    let needed = n_more * TRIANGLE_BYTES + (n_loaded + n_more) * TREE_BYTES;
    require(&format!("a scene of {} triangles", n_loaded + n_more), needed).map_err(|error| error.to_string())
}

/// Refuses to compute tangents for meshes with these numbers of faces if there is not enough memory for it. `n_copied`:
/// the number of faces that are copied before.
pub(super) fn require_for_tangents(mut n_faces: Vec<u64>, n_copied: u64) -> Checked<()> {
    n_faces.sort_unstable_by_key(|n| Reverse(*n));
    // Each thread works on one mesh at a time.
    let n_at_once: u64 = n_faces.iter().take(rayon::current_num_threads()).sum();
    let of_results = n_faces.iter().sum::<u64>().saturating_mul(TANGENT_BYTES);
    let needed = of_results
        .saturating_add(n_at_once.saturating_mul(MIKKTSPACE_BYTES))
        .saturating_add(n_copied.saturating_mul(TRIANGLE_BYTES));
    require("tangents for normal maps", needed).map_err(|error| error.to_string())
}

/// Refuses a text file that is too large for the memory. Accepts a file that cannot be read; reading it then fails.
pub(super) fn require_for_text(path: &Path) -> Checked<()> {
    require_for_copies(path, TEXT_COPIES)
}

/// Refuses a file of rows or facets that is too large for the memory, as [`require_for_text`] does for text.
pub(super) fn require_for_bytes(path: &Path) -> Checked<()> {
    require_for_copies(path, 1)
}

fn require_for_copies(path: &Path, n_copies: u64) -> Checked<()> {
    let n_bytes = fs::metadata(path).map_or(0, |metadata| metadata.len());
    require("reading it", n_bytes.saturating_mul(n_copies)).map_err(|error| error.to_string())
}
