//! Estimates of the memory that a scene needs, checked before it is allocated.

use std::cmp::Reverse;

use crate::{
    scene::model::{deformation::MorphDelta, error::Checked},
    util::memory::require,
};

/// Size of a loaded triangle in bytes without its points: three indices of corners (12), three normals (36) and a slot
/// (4).
const TRIANGLE_BYTES: u64 = 52;
/// Size of a point in bytes.
const POINT_BYTES: u64 = 12;
/// Size of a triangle's texture coordinates of one set, of its colours and of its tangents, bytes.
const UV_BYTES: u64 = 24;
const COLOUR_BYTES: u64 = 48;
const TANGENT_BYTES: u64 = 48;
/// Peak memory of building the tree in bytes per triangle, in addition to the triangles; a lower bound. A million
/// triangles of a sphere or a torus knot take 0.20 GB in all with `--build fast`, and 0.30 to 0.33 GB with
/// `--build best`.
const TREE_BYTES: u64 = 140;
/// Peak memory of MikkTSpace in bytes per triangle: what it notes of the triangle (160), its corners in a search tree
/// and in lists (150), edges (120), groups of corners (150) and tangents (120).
const MIKKTSPACE_BYTES: u64 = 700;
/// What triangles have beside corners, normals and slots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Attributes {
    /// Number of sets of texture coordinates.
    pub n_uv_sets: u64,
    pub has_colours: bool,
    pub has_tangents: bool,
}

/// The size of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct MeshSize {
    pub n_triangles: u64,
    pub n_points: u64,
    pub attributes: Attributes,
}

impl MeshSize {
    /// Returns the size of the loaded mesh, bytes.
    pub fn n_bytes(&self) -> u64 {
        let Attributes { n_uv_sets, has_colours, has_tangents } = self.attributes;
        let of_colours = if has_colours { COLOUR_BYTES } else { 0 };
        let of_tangents = if has_tangents { TANGENT_BYTES } else { 0 };
        let of_triangle = TRIANGLE_BYTES + n_uv_sets.min(2) * UV_BYTES + of_colours + of_tangents;
        self.n_triangles.saturating_mul(of_triangle).saturating_add(self.n_points.saturating_mul(POINT_BYTES))
    }
}

/// Refuses a mesh in addition to `n_loaded` triangles if there is not enough memory for it and for the tree over all
/// triangles.
pub(crate) fn require_for_mesh(n_loaded: u64, mesh: &MeshSize) -> Checked<()> {
    let n_triangles = n_loaded.saturating_add(mesh.n_triangles);
    let needed = n_triangles.saturating_mul(TREE_BYTES).saturating_add(mesh.n_bytes());
    Ok(require(&format!("a scene of {n_triangles} triangles"), needed)?)
}

/// Refuses to compute tangents for meshes with these numbers of faces if there is not enough memory for it. `n_copied`:
/// the number of faces that are copied before.
pub(crate) fn require_for_tangents(mut n_faces: Vec<u64>, n_copied: u64) -> Checked<()> {
    n_faces.sort_unstable_by_key(|n| Reverse(*n));
    // Each thread works on one mesh at a time.
    let sum = |n: &[u64]| n.iter().fold(0_u64, |sum, n| sum.saturating_add(*n));
    let n_at_once = sum(&n_faces[..n_faces.len().min(rayon::current_num_threads())]);
    let of_results = sum(&n_faces).saturating_mul(TANGENT_BYTES);
    let needed = of_results
        .saturating_add(n_at_once.saturating_mul(MIKKTSPACE_BYTES))
        .saturating_add(n_copied.saturating_mul(TRIANGLE_BYTES));
    Ok(require("tangents for normal maps", needed)?)
}

/// Refuses what `n_targets` morph targets add to `n_vertices` vertices if there is not enough memory for it.
pub(crate) fn require_for_morph_targets(n_targets: u64, n_vertices: u64) -> Checked<()> {
    let needed = n_targets.saturating_mul(n_vertices).saturating_mul(size_of::<MorphDelta>() as u64);
    Ok(require("what morph targets add", needed)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_triangles_have_counts() {
        let size = |attributes| MeshSize { n_triangles: 10, n_points: 5, attributes }.n_bytes();
        assert_eq!(size(Attributes::default()), 520 + 60);
        assert_eq!(size(Attributes { n_uv_sets: 2, has_colours: true, has_tangents: true }), 1960 + 60);
    }

    #[test]
    fn sums_do_not_overflow() {
        let attributes = Attributes { n_uv_sets: u64::MAX, has_colours: true, has_tangents: true };
        let mesh = MeshSize { n_triangles: u64::MAX, n_points: u64::MAX, attributes };
        for n_loaded in [0, u64::MAX] {
            assert!(require_for_mesh(n_loaded, &mesh).unwrap_err().contains("a scene of 18446744073709551615"));
        }
        // 2^63 times an even number is 0 in 64 bits.
        assert!(require_for_mesh(1 << 63, &MeshSize::default()).is_err());
        assert!(require_for_tangents(vec![u64::MAX, 7], u64::MAX).is_err());
        assert!(require_for_tangents(vec![1 << 63], 0).is_err());
    }
}
