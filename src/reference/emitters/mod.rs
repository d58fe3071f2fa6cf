//! The emitters of the path tracer: what a point of a surface may get light from. Twin of `emitters/emitters.glsl`.

pub mod alias;
pub mod area_light;
mod disk;
pub mod environment;
pub mod pick;
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
    alias::pick_alias,
    area_light::pick_area_light,
    environment::pick_sun,
    punctual::pick_punctual,
    tree::{pick_in_tree, tree_probability},
    triangle::{area_pdf, pick_triangle},
};
pub use self::{
    area_light::{SeenLight, seen_light},
    environment::{ambient_radiance, pick_environment, seen_environment},
    pick::LightPick,
    triangle::emission_at,
};
use super::inputs::KernelInputs;
use crate::layout::{EMITTER_AREA, EMITTER_LIGHT, EMITTER_SUN, EMITTER_TREE, EMITTER_TRIANGLE, Emitter};

/// The share of the way to a light within which another light hides it. What is beyond counts as the light itself.
pub const LIGHT_HIDES_UP_TO: f32 = 0.9999;

/// Picks a direction from which light may come to a point. `u` is in [0, 1), and `u.x` selects the emitter. Occluders
/// are ignored, except for rectangles, disks and spheres, which only [`seen_light`] knows.
pub fn pick_light(inputs: &KernelInputs, point_world: Vec3, u: Vec3) -> LightPick {
    pick_light_with(inputs, point_world, u, None)
}

/// Does what [`pick_light`] does. `of_environment`: what [`pick_environment`] returns for `u.yz`, if it is known
/// already.
pub fn pick_light_with(
    inputs: &KernelInputs,
    point_world: Vec3,
    u: Vec3,
    of_environment: Option<&LightPick>,
) -> LightPick {
    let pick = pick_emitter(inputs, point_world, u, of_environment);
    let before = seen_light(inputs, point_world, pick.direction, LIGHT_HIDES_UP_TO * pick.distance);
    if before.t.is_infinite() { pick } else { LightPick::NONE }
}

/// Picks as [`pick_light_with`] does. All occluders are ignored.
pub fn pick_emitter(
    inputs: &KernelInputs,
    point_world: Vec3,
    u: Vec3,
    of_environment: Option<&LightPick>,
) -> LightPick {
    let Some(emitters) = inputs.emitters.filter(|emitters| !emitters.entries.is_empty()) else {
        return LightPick::NONE;
    };
    // Tables of many entries need more bits than u.x has. The lowest bits of u.y hardly move the point that is picked.
    let more = (u.y * 4096.0).fract();
    let entry = |ix: u32| (emitters.entries[ix as usize].threshold, emitters.entries[ix as usize].alias_ix);
    let picked = pick_alias(emitters.n_picked as u32, entry, u.x, more);
    let mut emitter = emitters.entries[picked.ix as usize];
    if emitter.kind == EMITTER_TREE {
        let light = pick_in_tree(&emitters.light_nodes, point_world, picked.rest, more);
        emitter = emitters.entries[light.emitter_ix as usize];
        emitter.probability *= light.probability;
    }
    let (ix, rest) = (emitter.ix as usize, Vec2::new(u.y, u.z));
    match emitter.kind {
        EMITTER_LIGHT => pick_punctual(&inputs.lights[ix], point_world, emitter.probability),
        EMITTER_AREA => pick_area_light(emitters.shapes()[ix], point_world, rest, emitter.probability),
        EMITTER_SUN => pick_sun(emitters, &emitters.suns()[ix], rest),
        EMITTER_TRIANGLE => pick_triangle(inputs, emitter.ix, point_world, rest, emitter.probability),
        _ => of_environment.copied().unwrap_or_else(|| pick_environment(emitters, rest)),
    }
}

/// The pdf with which [`pick_light`] picks the point of a triangle that is seen from a point in a direction at a
/// distance, per steradian; 0 for a triangle that is never picked. `direction`: a unit vector.
pub fn emission_pdf(inputs: &KernelInputs, triangle_ix: u32, point_world: Vec3, direction: Vec3, distance: f32) -> f32 {
    let Some(emitters) = inputs.emitters else { return 0.0 };
    let triangles = emitters.triangles();
    let Ok(ix) = triangles.binary_search_by_key(&triangle_ix, |emitter| emitter.ix) else { return 0.0 };
    let Emitter { mut probability, alias_ix, .. } = triangles[ix];
    if emitters.has_tree() {
        probability *= tree_probability(&emitters.light_nodes, point_world, alias_ix);
    }
    probability * area_pdf(&inputs.triangles[triangle_ix as usize], direction, distance)
}
