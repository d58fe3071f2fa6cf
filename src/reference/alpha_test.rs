//! The alpha test: a hit counts only where the surface's opacity is high enough. Twin of `shading/alpha_test.glsl`.

use super::{
    sampler::{mixed, unit_number},
    texture::{sample_texture, scalar_of, uv_set_of},
};
use crate::{
    layout::{
        Hit, MAPS_ALPHA_BLEND, MAPS_ALPHA_MASK, MAPS_COLOUR_HAS_OPACITY, MAPS_CORNERS_HAVE_OPACITY, MAPS_SHADOW_TEST,
        MaterialMaps, NO_TEXTURE,
    },
    world::Textures,
};

/// The texture's value at a point of a triangle, in its largest level.
fn finest_at(textures: &Textures, texture_ix: u32, triangle_ix: u32, [u, v]: [f32; 2]) -> glam::Vec4 {
    let map = &textures.textures[texture_ix as usize];
    sample_texture(&textures.texels, map, textures.uv_at(triangle_ix, uv_set_of(map), u, v), 0.0)
}

/// The opacity at a point of a triangle, 0 to 1, by the largest levels of its textures. `opacity`: that of the
/// material. `at`: barycentric weights of the second and the third corner.
pub fn opacity_at(textures: &Textures, maps: &MaterialMaps, mut opacity: f32, triangle_ix: u32, at: [f32; 2]) -> f32 {
    if maps.flags & MAPS_CORNERS_HAVE_OPACITY != 0 {
        opacity *= textures.corner_colour_at(triangle_ix, at[0], at[1]).w;
    }
    if maps.flags & MAPS_COLOUR_HAS_OPACITY != 0 && maps.base_colour != NO_TEXTURE {
        opacity *= finest_at(textures, maps.base_colour, triangle_ix, at).w;
    }
    if maps.opacity != NO_TEXTURE {
        let map = &textures.textures[maps.opacity as usize];
        opacity *= scalar_of(map, finest_at(textures, maps.opacity, triangle_ix, at));
    }
    opacity
}

/// A random number in [0, 1) for a point of a triangle. Different rays hit different points.
fn random_at(hit: &Hit) -> f32 {
    unit_number(mixed(hit.u.to_bits() ^ mixed(hit.v.to_bits() ^ mixed(hit.triangle_ix))))
}

/// Whether a ray passes through a triangle at a hit. `tests_blended`: whether the ray is a shadow ray, which also
/// passes through blended surfaces with an opacity below `LEAST_SHADOWING_OPACITY`. `is_random`: whether it passes
/// through them at random instead, as often as the opacity says.
pub fn fails_alpha_test(
    textures: &Textures,
    material_ix: u32,
    hit: &Hit,
    tests_blended: bool,
    is_random: bool,
) -> bool {
    let kinds = match (is_random, tests_blended) {
        (true, _) => MAPS_ALPHA_MASK | MAPS_ALPHA_BLEND,
        (false, true) => MAPS_ALPHA_MASK | MAPS_SHADOW_TEST,
        (false, false) => MAPS_ALPHA_MASK,
    };
    let maps = &textures.material_maps[material_ix as usize];
    if maps.flags & kinds == 0 {
        return false;
    }
    let at = [hit.u, hit.v];
    if is_random && maps.flags & MAPS_ALPHA_BLEND != 0 {
        return random_at(hit) >= opacity_at(textures, maps, maps.coverage, hit.triangle_ix, at);
    }
    opacity_at(textures, maps, maps.opacity_factor, hit.triangle_ix, at) < maps.alpha_cutoff
}
