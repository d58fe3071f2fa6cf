// The alpha test: a hit counts only where the surface's opacity is high enough. Rays of every kind test masked
// materials, which are either opaque or not there. Shadow rays also test blended materials. Kernels that define
// STOCHASTIC_ALPHA trace paths, whose rays of all kinds pass through blended materials at random, as often as the
// opacity says. Twin of src/reference/alpha_test.rs.
//
// Needs nothing: it includes texture.glsl. Provides `ALPHA_MASKS`, `SHADOW_ALPHA_TEST`, `opacity_at` and
// `fails_alpha_test`.
#ifndef KDRAY_ALPHA_TEST
#define KDRAY_ALPHA_TEST

#include "layout.glsl"
#include "shading/texture_words.glsl"
#include "shading/texture.glsl"

layout(constant_id = CONSTANT_ALPHA_MASKS) const bool ALPHA_MASKS = false;
layout(constant_id = CONSTANT_SHADOW_ALPHA_TEST) const bool SHADOW_ALPHA_TEST = false;

#ifdef STOCHASTIC_ALPHA
#include "sampler.glsl"

// A random number in [0, 1) for a point of a triangle. Different rays hit different points.
float random_at(uint triangle_ix, float u, float v) {
    return unit_number(mixed(floatBitsToUint(u) ^ mixed(floatBitsToUint(v) ^ mixed(triangle_ix))));
}
#endif

// The opacity at a point of a triangle, 0..1, by mip 0 of its textures. opacity: that of the material.
float opacity_at(MaterialMaps maps, float opacity, uint triangle_ix, float u, float v) {
    if ((maps.flags & MAPS_CORNERS_HAVE_OPACITY) != 0u) opacity *= corner_colour_at(triangle_ix, u, v).a;
    for (uint i = 0u; i < 2u; ++i) {
        bool is_colour = i == 0u;
        uint texture_ix = is_colour ? maps.base_colour : maps.opacity;
        bool counts = !is_colour || (maps.flags & MAPS_COLOUR_HAS_OPACITY) != 0u;
        if (!counts || texture_ix == NO_TEXTURE) continue;
        Texture map = texture_at(texture_ix);
        vec4 value = sample_finest(map, uv_at(triangle_ix, uv_set_of(map), u, v));
        opacity *= is_colour ? value.a : scalar_of(map, value);
    }
    return opacity;
}

// Whether a ray passes through a triangle at a point. tests_blended: whether blended materials are tested, too.
bool fails_alpha_test(uint triangle_ix, float u, float v, bool tests_blended) {
    uint material_ix = load_triangle_materials(triangle_ix);
#ifdef STOCHASTIC_ALPHA
    uint kinds = MAPS_ALPHA_MASK | MAPS_ALPHA_BLEND;
#else
    uint kinds = tests_blended ? MAPS_ALPHA_MASK | MAPS_SHADOW_TEST : MAPS_ALPHA_MASK;
#endif
    if ((map_flags_of(material_ix) & kinds) == 0u) return false;
    MaterialMaps maps = maps_of(material_ix);
#ifdef STOCHASTIC_ALPHA
    if ((maps.flags & MAPS_ALPHA_BLEND) != 0u) {
        // A random number is below 1, so an opaque point never fails the test; at opacity 0, every point does.
        return random_at(triangle_ix, u, v) >= opacity_at(maps, maps.coverage, triangle_ix, u, v);
    }
#endif
    return opacity_at(maps, maps.opacity_factor, triangle_ix, u, v) < maps.alpha_cutoff;
}

#endif
