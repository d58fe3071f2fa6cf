// Gaps: the parts of a triangle through which rays pass, since the opacity there is too low. Rays of every kind pass
// through the gaps of a cut-out, a material that is either opaque or not there. Shadow rays also pass through the gaps
// of a veil, a see-through material. Kernels that define RANDOM_OPACITY trace paths, whose rays of all kinds pass
// through see-through materials at random, as often as the opacity says. Twin of src/reference/cutout.rs.
//
// Needs nothing: it includes texture.glsl. Provides `CUTOUTS`, `SHADOW_GAPS`, `opacity_at` and `is_gap`.
#ifndef KDRAY_CUTOUT
#define KDRAY_CUTOUT

#include "layout.glsl"
#include "texture_words.glsl"
#include "texture.glsl"

layout(constant_id = CONSTANT_CUTOUTS) const bool CUTOUTS = false;
layout(constant_id = CONSTANT_SHADOW_GAPS) const bool SHADOW_GAPS = false;

#ifdef RANDOM_OPACITY
#include "sampler.glsl"

// A random number in [0, 1) for a point of a triangle. Different rays hit different points.
float random_at(uint triangle_ix, float u, float v) {
    return unit_number(mixed(floatBitsToUint(u) ^ mixed(floatBitsToUint(v) ^ mixed(triangle_ix))));
}
#endif

// The opacity at a point of a triangle, 0..1, by the largest levels of its textures. opacity: that of the material.
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

// Whether a ray passes through a triangle at a point. passes_veils: whether the gaps of veils count, too.
bool is_gap(uint triangle_ix, float u, float v, bool passes_veils) {
    uint material_ix = load_triangle_materials(triangle_ix);
#ifdef RANDOM_OPACITY
    uint kinds = MAPS_CUTOUT | MAPS_COVERAGE;
#else
    uint kinds = passes_veils ? MAPS_CUTOUT | MAPS_VEIL : MAPS_CUTOUT;
#endif
    if ((map_flags_of(material_ix) & kinds) == 0u) return false;
    MaterialMaps maps = maps_of(material_ix);
#ifdef RANDOM_OPACITY
    if ((maps.flags & MAPS_COVERAGE) != 0u) {
        // A random number is below 1, so an opaque point is never a gap; at opacity 0, every point is one.
        return random_at(triangle_ix, u, v) >= opacity_at(maps, maps.coverage, triangle_ix, u, v);
    }
#endif
    return opacity_at(maps, maps.opacity_factor, triangle_ix, u, v) < maps.alpha_cutoff;
}

#endif
