//! The alpha test: a hit counts only where the surface's opacity is high enough. Twin of `shading/alpha_test.glsl`.

use super::{
    sampler::{SampleKey, mixed, unit_number},
    texture::{sample_texture, scalar_of, uv_set_of},
};
use crate::{
    layout::{
        Hit, LEAST_SEEN_OPACITY, MAPS_ALPHA_BLEND, MAPS_ALPHA_MASK, MAPS_CLEAR_TEST, MAPS_COLOUR_HAS_OPACITY,
        MAPS_CORNERS_HAVE_OPACITY, MAPS_SHADOW_TEST, MaterialMaps, NO_TEXTURE,
    },
    world::{Textures, instances::Stored},
};

/// The texture's value at a point of a triangle, in its largest level.
fn finest_at(textures: &Textures, texture_ix: u32, at: &Stored, [u, v]: [f32; 2]) -> glam::Vec4 {
    let map = &textures.textures[texture_ix as usize];
    sample_texture(&textures.texels, map, textures.uv_at(at, uv_set_of(map), u, v), 0.0)
}

/// The opacity at a point of a triangle, 0 to 1, by the largest levels of its textures. `opacity`: that of the
/// material. `weights`: barycentric, of the second and the third corner.
pub fn opacity_at(textures: &Textures, maps: &MaterialMaps, mut opacity: f32, at: &Stored, weights: [f32; 2]) -> f32 {
    if maps.flags & MAPS_CORNERS_HAVE_OPACITY != 0 {
        opacity *= textures.corner_colour_at(at, weights[0], weights[1]).w;
    }
    if maps.flags & MAPS_COLOUR_HAS_OPACITY != 0 && maps.base_colour != NO_TEXTURE {
        opacity *= finest_at(textures, maps.base_colour, at, weights).w;
    }
    if maps.opacity != NO_TEXTURE {
        let map = &textures.textures[maps.opacity as usize];
        opacity *= scalar_of(map, finest_at(textures, maps.opacity, at, weights));
    }
    opacity
}

/// The seed of the decisions of a path's ray. `depth`: the bounce in which the ray is traced.
pub fn alpha_seed_of(key: SampleKey, depth: u32, is_shadow_ray: bool) -> u32 {
    mixed(key.pixel ^ mixed(key.sample_ix ^ mixed(2 * depth + u32::from(is_shadow_ray))))
}

/// Whether a ray passes through a triangle at a hit: through masked surfaces, and through blended ones where they are
/// clear. `tests_blended`: whether the ray is a shadow ray, which also passes through blended surfaces with an opacity
/// below `LEAST_SHADOWING_OPACITY`. `alpha_seed`: of a path's ray, which passes through blended ones at random
/// instead, as often as the opacity says.
pub fn fails_alpha_test(
    textures: &Textures,
    material_ix: u32,
    (hit, at): (&Hit, &Stored),
    tests_blended: bool,
    alpha_seed: Option<u32>,
) -> bool {
    let masks = if tests_blended { MAPS_ALPHA_MASK | MAPS_SHADOW_TEST } else { MAPS_ALPHA_MASK };
    let kinds = if alpha_seed.is_some() { MAPS_ALPHA_MASK | MAPS_ALPHA_BLEND } else { masks | MAPS_CLEAR_TEST };
    let maps = &textures.material_maps[material_ix as usize];
    if maps.flags & kinds == 0 {
        return false;
    }
    let weights = [hit.u, hit.v];
    if let Some(seed) = alpha_seed.filter(|_| maps.flags & MAPS_ALPHA_BLEND != 0) {
        let random = unit_number(mixed(seed ^ mixed(hit.triangle_ix)));
        return random >= opacity_at(textures, maps, maps.coverage, at, weights);
    }
    if alpha_seed.is_none() && maps.flags & masks == 0 {
        return opacity_at(textures, maps, maps.coverage, at, weights) < LEAST_SEEN_OPACITY;
    }
    opacity_at(textures, maps, maps.opacity_factor, at, weights) < maps.alpha_cutoff
}
