//! The closest hit over all triangles, without a tree. The traversal must find the same hit. Twin of
//! `search/brute.glsl`.

use super::{search_ray::SearchRay, triangle::Shear};
use crate::layout::{Hit, NO_TRIANGLE, Triangle};

/// Returns the hit of smallest t in (t_min, t_max]. Of several at the same t, it is the one with the lowest triangle
/// index. A miss has t = t_max.
pub fn closest_hit(triangles: &[Triangle], ray: &SearchRay) -> Hit {
    let shear = Shear::of(ray.origin.to_array(), ray.direction.to_array());
    let mut best = ray.miss();
    for (triangle_ix, triangle) in (0..).zip(triangles) {
        let hit = shear.intersect_triangle(triangle, triangle_ix);
        let is_nearer =
            |hit: &Hit| hit.t > ray.t_min && (hit.t < best.t || hit.t == best.t && best.triangle_ix == NO_TRIANGLE);
        let is_target = triangle_ix != ray.source_triangle;
        if let Some(hit) = hit.filter(|hit| is_target && is_nearer(hit)) {
            best = hit;
        }
    }
    best
}
