//! The surface at a hit, and the rays that leave it. Twin of `shading/surface.glsl`.

use glam::{Vec2, Vec3};

use crate::{
    layout::{
        CURVED_START_COSINE, FLAT_NORMAL, Hit, LEAST_NORMAL_SQUARED, LEAST_ORIGIN_OFFSET_SHARE, LEAST_WEIGHT,
        ORIGIN_OFFSET, PLANE_START_COSINE, PathRay, Triangle,
    },
    world::instances::Stored,
};

/// The surface of a triangle at a hit, as the ray meets it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    pub point_world: Vec3,
    /// The unit normal of the triangle's plane, on the side that the ray comes from.
    pub geometric: Vec3,
    /// The interpolated unit normal, on the same side.
    pub interpolated: Vec3,
    /// The interpolated normal, or what a normal map makes of it, on the same side.
    pub shading: Vec3,
    /// Whether `interpolated` is the reverse of what the corners' normals give.
    pub is_reversed: bool,
    /// Distance along `geometric` at which a new ray starts so that it does not hit this surface, world units.
    pub origin_offset: f32,
    /// Whether the ray meets the triangle's back. The ray then counts as inside a solid.
    pub from_inside: bool,
}

/// GLSL's `unpackSnorm2x16`.
fn unpack_snorm_2x16(code: u32) -> Vec2 {
    let component = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).clamp(-1.0, 1.0);
    Vec2::new(component(code), component(code >> 16))
}

/// The unit vector of an octahedral 2 x snorm16 code.
pub fn decode_normal(code: u32) -> Vec3 {
    let p = unpack_snorm_2x16(code);
    let mut n = Vec3::new(p.x, p.y, 1.0 - p.x.abs() - p.y.abs());
    let fold = (-n.z).max(0.0);
    n.x += if n.x >= 0.0 { -fold } else { fold };
    n.y += if n.y >= 0.0 { -fold } else { fold };
    n.normalize()
}

/// The interpolated unit normal, or `geometric` if a corner has none or the corners' normals cancel out.
fn shading_normal(t: &Triangle, hit: &Hit, geometric: Vec3) -> Vec3 {
    if [t.n0, t.n1, t.n2].contains(&FLAT_NORMAL) {
        return geometric;
    }
    let n = (1.0 - hit.u - hit.v) * decode_normal(t.n0) + hit.u * decode_normal(t.n1) + hit.v * decode_normal(t.n2);
    let squared = n.dot(n);
    if squared > LEAST_NORMAL_SQUARED { n * (1.0 / squared.sqrt()) } else { geometric }
}

/// Barycentric weights of the hit, at least [`LEAST_WEIGHT`] each before they are normalized, so that the point is
/// not on an edge.
fn inner_weights(hit: &Hit) -> Vec3 {
    let weights = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v).max(Vec3::splat(LEAST_WEIGHT));
    weights / (weights.x + weights.y + weights.z)
}

/// The surface of triangle `t` of a flat world at a hit.
pub fn surface_at(ray: &PathRay, hit: &Hit, t: &Triangle) -> Surface {
    surface_of(ray, hit, t, &Stored { row: 0, instance: None })
}

/// The surface of triangle `t`, which is stored `at` a place, at a hit. Its point is interpolated from the corners.
pub fn surface_of(ray: &PathRay, hit: &Hit, t: &Triangle, at: &Stored) -> Surface {
    let weights = inner_weights(hit);
    let magnitude = (weights.x * t.v0).abs() + (weights.y * t.v1).abs() + (weights.z * t.v2).abs();
    // The edges are scaled to about 1, since the cross product of a tiny triangle would underflow.
    let (e1, e2) = (t.v1 - t.v0, t.v2 - t.v0);
    let span = e1.abs().max(e2.abs());
    let scale = 1.0 / span.x.max(span.y.max(span.z));
    let outward = (e1 * scale).cross(e2 * scale).normalize();
    let from_inside = outward.dot(ray.direction) > 0.0;
    let geometric = if from_inside { -outward } else { outward };
    let interpolated = shading_normal(t, hit, outward);
    let is_reversed = interpolated.dot(geometric) < 0.0;
    let interpolated = if is_reversed { -interpolated } else { interpolated };
    let point_world = weights.x * t.v0 + weights.y * t.v1 + weights.z * t.v2;
    let largest = magnitude.max_element().max(at.placement_error(t, weights));
    Surface {
        point_world,
        geometric,
        interpolated,
        shading: interpolated,
        is_reversed,
        origin_offset: ORIGIN_OFFSET * magnitude.dot(geometric.abs()).max(LEAST_ORIGIN_OFFSET_SHARE * largest),
        from_inside,
    }
}

/// The part of `p`, relative to a corner, that is not below the plane through the corner with the normal of that
/// corner.
fn above_corner(p: Vec3, corner: Vec3, normal: u32, interpolated: Vec3) -> Vec3 {
    let n = decode_normal(normal);
    let n = if n.dot(interpolated) < 0.0 { -n } else { n };
    p - (p - corner).dot(n).min(0.0) * n
}

/// The point at which a ray to a light starts. If the light is near the horizon of the triangle's plane, it is the
/// surface's point, moved up to the curved surface that the corners' normals suggest, if that is above the triangle
/// (Hanika: Hacking the Shadow Terminator, Ray Tracing Gems II, 2021).
pub fn lit_point(s: &Surface, hit: &Hit, t: &Triangle, to_light: Vec3) -> Vec3 {
    if [t.n0, t.n1, t.n2].contains(&FLAT_NORMAL) {
        return s.point_world;
    }
    let span = PLANE_START_COSINE - CURVED_START_COSINE;
    let share = ((PLANE_START_COSINE - s.geometric.dot(to_light)) / span).clamp(0.0, 1.0);
    // Not `<=`: a NaN stays where it is.
    if !(share > 0.0) {
        return s.point_world;
    }
    let weights = inner_weights(hit);
    let curved = weights.x * above_corner(s.point_world, t.v0, t.n0, s.interpolated)
        + weights.y * above_corner(s.point_world, t.v1, t.n1, s.interpolated)
        + weights.z * above_corner(s.point_world, t.v2, t.n2, s.interpolated);
    s.point_world + share * (curved - s.point_world)
}

impl Surface {
    /// Returns a child ray from the surface, with the parent's `t_max`. It starts on the side of the surface to which
    /// its direction points. `triangle_ix`: the surface's triangle, which the ray does not hit.
    pub fn ray_from(&self, direction: Vec3, triangle_ix: u32, parent: &PathRay, throughput: Vec3) -> PathRay {
        let side = if direction.dot(self.geometric) < 0.0 { -self.origin_offset } else { self.origin_offset };
        PathRay {
            origin: self.point_world + side * self.geometric,
            pixel_ix: parent.pixel_ix,
            direction,
            source_triangle: triangle_ix,
            throughput,
            t_max: parent.t_max,
        }
    }
}
