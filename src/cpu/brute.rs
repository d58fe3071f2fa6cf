//! Closest hit over every triangle, without a tree: what the traversal must find. Twin of `brute.glsl`.

use super::triangle::Shear;
use crate::layout::{Hit, NO_TRIANGLE, Ray, Triangle};

/// The hit of smallest t in (0, t_max]; at one t, that of the lowest index. A miss keeps t = t_max.
pub fn closest_hit(triangles: &[Triangle], ray: &Ray) -> Hit {
    closest_hit_beyond(triangles, ray, 0.0)
}

/// As [`closest_hit`], in (t_min, t_max].
pub fn closest_hit_beyond(triangles: &[Triangle], ray: &Ray, t_min: f32) -> Hit {
    let shear = Shear::of(ray.origin.to_array(), ray.direction.to_array());
    let mut best = Hit { t: ray.t_max, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };
    for (triangle_ix, triangle) in (0..).zip(triangles) {
        let hit = shear.intersect_triangle(triangle, triangle_ix);
        let is_nearer =
            |hit: &Hit| hit.t > t_min && (hit.t < best.t || hit.t == best.t && best.triangle_ix == NO_TRIANGLE);
        if let Some(hit) = hit.filter(|hit| triangle_ix != ray.source_triangle && is_nearer(hit)) {
            best = hit;
        }
    }
    best
}
