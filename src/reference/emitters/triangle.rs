//! Triangles whose material emits light, to both sides. Twin of `emitters/triangle.glsl`.

use glam::{Vec2, Vec3};

use super::light_sample::{LightSample, MOST_LIGHT, sample_of_point, towards};
use crate::{
    layout::{MATERIAL_UNLIT, NO_TEXTURE, Triangle},
    reference::{
        inputs::KernelInputs,
        texture::{sample_texture, uv_set_of},
    },
};

/// The radiance that a triangle emits at barycentric weights of its second and third corner, by the largest level of
/// its texture. A surface without shading (`unlit`) emits nothing.
pub fn emission_at(inputs: &KernelInputs, triangle_ix: u32, u: f32, v: f32) -> Vec3 {
    let material_ix = inputs.material_ix_of(triangle_ix) as usize;
    let material = &inputs.materials[material_ix];
    if material.flags & MATERIAL_UNLIT != 0 {
        return Vec3::ZERO;
    }
    let Some(textures) = inputs.textures else { return material.ke };
    let texture_ix = textures.material_maps[material_ix].emission;
    if texture_ix == NO_TEXTURE {
        return material.ke;
    }
    let map = &textures.textures[texture_ix as usize];
    let uv = textures.uv_at(&inputs.stored(triangle_ix), uv_set_of(map), u, v);
    material.ke * sample_texture(&textures.texels, map, uv, 0.0).truncate().max(Vec3::ZERO)
}

/// Pdf per steradian of a direction in which the triangle is seen at a distance, if its points are sampled
/// uniformly.
pub(super) fn area_pdf(t: &Triangle, direction: Vec3, distance: f32) -> f32 {
    // Twice the area, times the cosine.
    let facing = (t.v1 - t.v0).cross(t.v2 - t.v0).dot(direction).abs();
    let pdf = 2.0 * distance * distance / facing;
    if pdf < MOST_LIGHT { pdf } else { 0.0 }
}

/// Barycentric weights of a triangle's second and third corner, uniform on its area.
fn triangle_weights(u: Vec2) -> Vec2 {
    if u.y > u.x { Vec2::new(0.5 * u.x, u.y - 0.5 * u.x) } else { Vec2::new(u.x - 0.5 * u.y, 0.5 * u.y) }
}

/// `probability`: with which this triangle is sampled.
pub(super) fn sample_triangle(
    inputs: &KernelInputs,
    triangle_ix: u32,
    point_world: Vec3,
    u: Vec2,
    probability: f32,
) -> LightSample {
    let t = &inputs.triangle(triangle_ix);
    let weights = triangle_weights(u);
    let point = t.v0 + weights.x * (t.v1 - t.v0) + weights.y * (t.v2 - t.v0);
    let way = towards(point_world, point);
    let pdf = probability * area_pdf(t, way.direction, way.distance);
    sample_of_point(way, emission_at(inputs, triangle_ix, weights.x, weights.y), pdf)
}
