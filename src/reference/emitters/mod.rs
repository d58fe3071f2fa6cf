//! The emitters of the path tracer: what a point of a surface may get light from. Twin of `emitters/emitters.glsl`.

pub mod alias;
pub mod area_light;
mod disk;
pub mod environment;
pub mod light_sample;
pub mod punctual;
mod rectangle;
mod sphere;
mod sun;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_of_many;
pub mod tree;
pub mod triangle;

use glam::{Vec2, Vec3};

use self::{
    alias::sample_alias,
    area_light::sample_area_light,
    environment::sample_sun,
    punctual::sample_punctual,
    tree::{sample_in_tree, tree_probability},
    triangle::{area_pdf, sample_triangle},
};
pub use self::{
    area_light::{SeenLight, seen_light},
    environment::{ambient_radiance, sample_environment, seen_environment},
    light_sample::LightSample,
    triangle::emission_at,
};
use super::inputs::KernelInputs;
use crate::layout::{EMITTER_AREA, EMITTER_LIGHT, EMITTER_SUN, EMITTER_TREE, EMITTER_TRIANGLE, Emitter};

/// The share of the way to a light within which another light hides it. What is beyond counts as the light itself.
pub const LIGHT_HIDES_UP_TO: f32 = 0.9999;

/// Samples a direction from which light may come to a point. `u` is in [0, 1), and `u.x` selects the emitter. Occluders
/// are ignored, except for rectangles, disks and spheres, which only [`seen_light`] knows.
pub fn sample_light(inputs: &KernelInputs, point_world: Vec3, u: Vec3) -> LightSample {
    sample_light_with(inputs, point_world, u, None)
}

/// Does what [`sample_light`] does. `of_environment`: what [`sample_environment`] returns for `u.yz`, if it is known
/// already.
pub fn sample_light_with(
    inputs: &KernelInputs,
    point_world: Vec3,
    u: Vec3,
    of_environment: Option<&LightSample>,
) -> LightSample {
    let sample = sample_emitter(inputs, point_world, u, of_environment);
    let before = seen_light(inputs, point_world, sample.direction, LIGHT_HIDES_UP_TO * sample.distance);
    if before.t.is_infinite() { sample } else { LightSample::NONE }
}

/// Samples as [`sample_light_with`] does. All occluders are ignored.
pub fn sample_emitter(
    inputs: &KernelInputs,
    point_world: Vec3,
    u: Vec3,
    of_environment: Option<&LightSample>,
) -> LightSample {
    let Some(emitters) = inputs.emitters.filter(|emitters| !emitters.entries.is_empty()) else {
        return LightSample::NONE;
    };
    // Tables of many entries need more bits than u.x has. The lowest bits of u.y hardly move the point that is sampled.
    let more = (u.y * 4096.0).fract();
    let entry = |ix: u32| (emitters.entries[ix as usize].threshold, emitters.entries[ix as usize].alias_ix);
    let sampled = sample_alias(emitters.n_sampled as u32, entry, u.x, more);
    let mut emitter = emitters.entries[sampled.ix as usize];
    if emitter.kind == EMITTER_TREE {
        let light = sample_in_tree(&emitters.light_nodes, point_world, sampled.rest, more);
        emitter = emitters.entries[light.emitter_ix as usize];
        emitter.probability *= light.probability;
    }
    let (ix, rest) = (emitter.ix as usize, Vec2::new(u.y, u.z));
    match emitter.kind {
        EMITTER_LIGHT => sample_punctual(&inputs.lights[ix], point_world, emitter.probability),
        EMITTER_AREA => sample_area_light(emitters.shapes()[ix], point_world, rest, emitter.probability),
        EMITTER_SUN => sample_sun(emitters, &emitters.suns()[ix], rest),
        EMITTER_TRIANGLE => sample_triangle(inputs, emitter.ix, point_world, rest, emitter.probability),
        _ => of_environment.copied().unwrap_or_else(|| sample_environment(emitters, rest)),
    }
}

/// The pdf with which [`sample_light`] samples the point of a triangle that is seen from a point in a direction at a
/// distance, per steradian; 0 for a triangle that is never sampled. `direction`: a unit vector.
pub fn emission_pdf(inputs: &KernelInputs, triangle_ix: u32, point_world: Vec3, direction: Vec3, distance: f32) -> f32 {
    let Some(emitters) = inputs.emitters else { return 0.0 };
    let triangles = emitters.triangles();
    let Ok(ix) = triangles.binary_search_by_key(&triangle_ix, |emitter| emitter.ix) else { return 0.0 };
    let Emitter { mut probability, alias_ix, .. } = triangles[ix];
    if emitters.has_tree() {
        probability *= tree_probability(&emitters.light_nodes, point_world, alias_ix);
    }
    probability * area_pdf(&inputs.triangle(triangle_ix), direction, distance)
}
