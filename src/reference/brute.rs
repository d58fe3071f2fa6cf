//! Closest hit over every triangle, without a tree: what the traversal must find. Twin of `brute.glsl`.

use super::{search_ray::SearchRay, triangle::Shear};
use crate::layout::{Hit, NO_TRIANGLE, Triangle};

/// The hit of smallest t in (t_min, t_max]; at one t, that of the lowest index. A miss keeps t = t_max.
pub fn closest_hit(triangles: &[Triangle], ray: &SearchRay) -> Hit {
    closest_hit_of(triangles, ray, |_| true)
}

/// The same, of the triangles of which `is_accepted` says so by their indices.
pub fn closest_hit_of(triangles: &[Triangle], ray: &SearchRay, is_accepted: impl Fn(u32) -> bool) -> Hit {
    let shear = Shear::of(ray.origin.to_array(), ray.direction.to_array());
    let mut best = ray.miss();
    for (triangle_ix, triangle) in (0..).zip(triangles) {
        let hit = shear.intersect_triangle(triangle, triangle_ix);
        let is_nearer =
            |hit: &Hit| hit.t > ray.t_min && (hit.t < best.t || hit.t == best.t && best.triangle_ix == NO_TRIANGLE);
        let is_target = triangle_ix != ray.source_triangle && is_accepted(triangle_ix);
        if let Some(hit) = hit.filter(|hit| is_target && is_nearer(hit)) {
            best = hit;
        }
    }
    best
}
