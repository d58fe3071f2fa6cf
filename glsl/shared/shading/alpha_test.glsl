// The alpha test: a hit counts only where the surface's opacity is high enough. Rays of every kind test masked
// materials, which are either opaque or not there, and pass through blended ones where these are clear. Shadow rays
// pass through blended materials where these are more clear than opaque. Kernels that define
// STOCHASTIC_ALPHA trace paths, whose rays of all kinds pass through blended materials at random, as often as the
// opacity says. Twin of src/reference/alpha_test.rs.
//
// Needs nothing: it includes texture.glsl. Provides `ALPHA_MASKS`, `SHADOW_ALPHA_TEST`, `opacity_at` and
// `fails_alpha_test`, and with STOCHASTIC_ALPHA, which needs search/local_memory.glsl, `seed_alpha_test`.
#ifndef KDRAY_ALPHA_TEST
#define KDRAY_ALPHA_TEST

#include "layout.glsl"
#include "shading/texture_words.glsl"
#include "shading/texture.glsl"

layout(constant_id = CONSTANT_ALPHA_MASKS) const bool ALPHA_MASKS = false;
layout(constant_id = CONSTANT_SHADOW_ALPHA_TEST) const bool SHADOW_ALPHA_TEST = false;

#ifdef STOCHASTIC_ALPHA
#include "sampler.glsl"

// Sets the seed of the decisions of the invocation's ray, of a path. It depends on integers alone: devices round
// positions differently, and would make independent noise of their bits. depth: the bounce in which the ray is traced.
void seed_alpha_test(SampleKey key, uint depth, bool is_shadow_ray) {
    spill_seed(mixed(key.pixel ^ mixed(key.sample_ix ^ mixed(2u * depth + (is_shadow_ray ? 1u : 0u)))));
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
    uint material_ix = material_ix_of(triangle_ix);
#ifdef STOCHASTIC_ALPHA
    uint kinds = MAPS_ALPHA_MASK | MAPS_ALPHA_BLEND;
#else
    uint masks = tests_blended ? MAPS_ALPHA_MASK | MAPS_SHADOW_TEST : MAPS_ALPHA_MASK;
    uint kinds = masks | MAPS_CLEAR_TEST;
#endif
    if ((map_flags_of(material_ix) & kinds) == 0u) return false;
    MaterialMaps maps = maps_of(material_ix);
#ifdef STOCHASTIC_ALPHA
    if ((maps.flags & MAPS_ALPHA_BLEND) != 0u) {
        // A random number is below 1, so an opaque point never fails the test; at opacity 0, every point does.
        float random = unit_number(mixed(spilled_seed() ^ mixed(triangle_ix)));
        return random >= opacity_at(maps, maps.coverage, triangle_ix, u, v);
    }
#else
    if ((maps.flags & masks) == 0u) {
        return opacity_at(maps, maps.coverage, triangle_ix, u, v) < LEAST_SEEN_OPACITY;
    }
#endif
    return opacity_at(maps, maps.opacity_factor, triangle_ix, u, v) < maps.alpha_cutoff;
}

#endif
