// Cut-outs: the parts of a triangle in which there is no surface, since the opacity of its texture is too low. Rays of
// every kind pass through them. Twin of src/reference/cutout.rs.
//
// Needs nothing: it includes texture.glsl. Provides `CUTOUTS`, `opacity_at` and `is_cut_out`.
#ifndef KDRAY_CUTOUT
#define KDRAY_CUTOUT

#include "layout.glsl"
#include "texture_words.glsl"
#include "texture.glsl"

layout(constant_id = CONSTANT_CUTOUTS) const bool CUTOUTS = false;

// The texture's value at a point of a triangle, in its largest level.
vec4 finest_at(uint texture_ix, uint triangle_ix, float u, float v) {
    Texture map = texture_at(texture_ix);
    return sample_texture(map, uv_at(triangle_ix, uv_set_of(map), u, v), 0.0);
}

// The opacity at a point of a triangle, 0..1, by the largest levels of its textures.
float opacity_at(MaterialMaps maps, uint triangle_ix, float u, float v) {
    float opacity = maps.opacity_factor;
    if ((maps.flags & MAPS_CORNERS_HAVE_OPACITY) != 0u) opacity *= corner_colour_at(triangle_ix, u, v).a;
    if ((maps.flags & MAPS_COLOUR_HAS_OPACITY) != 0u && maps.base_colour != NO_TEXTURE) {
        opacity *= finest_at(maps.base_colour, triangle_ix, u, v).a;
    }
    if (maps.opacity != NO_TEXTURE) {
        opacity *= scalar_of(texture_at(maps.opacity), finest_at(maps.opacity, triangle_ix, u, v));
    }
    return opacity;
}

// Whether a ray passes through a triangle at a point. passes_veils: whether the ray also passes through see-through
// surfaces with an opacity below LEAST_SHADOWING_OPACITY.
bool is_cut_out(uint triangle_ix, float u, float v, bool passes_veils) {
    uint material_ix = load_triangle_materials(triangle_ix);
    uint kinds = passes_veils ? MAPS_CUTOUT | MAPS_VEIL : MAPS_CUTOUT;
    MaterialMaps maps = maps_of(material_ix);
    if ((maps.flags & kinds) == 0u) return false;
    return opacity_at(maps, triangle_ix, u, v) < maps.alpha_cutoff;
}

#endif
