// The arrays in `texture_words`: the texels of images, and what leads from a triangle to them. They begin with the
// linear values of the 256 bytes of sRGB (src/world/mips.rs). The other arrays begin where `accel` says.
//
// Needs nothing: it includes scene.glsl. Provides `TEXTURED`, `load_texels`, `texture_at`, `maps_of`,
// `map_flags_of`, `uv_at`, `corner_uv`, `corner_surface` and `corner_colour_at`.
#ifndef KDRAY_TEXTURE_WORDS
#define KDRAY_TEXTURE_WORDS

#include "layout.glsl"
#include "scene.glsl"

layout(constant_id = CONSTANT_TEXTURED) const bool TEXTURED = false;

// A word of the tables and mip levels of images.
uint load_texels(uint word_ix) {
    return load_texture_words(word_ix);
}

float load_float(uint word_ix) {
    return uintBitsToFloat(load_texture_words(word_ix));
}

Texture texture_at(uint texture_ix) {
    uint at = accel.textures_begin + 12u * texture_ix;
    return Texture(
        load_float(at), load_float(at + 1u), load_float(at + 2u), load_texture_words(at + 3u),
        load_float(at + 4u), load_float(at + 5u), load_float(at + 6u), load_texture_words(at + 7u),
        load_texture_words(at + 8u), load_texture_words(at + 9u), 0u, 0u
    );
}

// The maps of a material.
MaterialMaps maps_of(uint material_ix) {
    uint at = accel.material_maps_begin + 16u * material_ix;
    return MaterialMaps(
        load_texture_words(at), load_texture_words(at + 1u), load_texture_words(at + 2u), load_texture_words(at + 3u),
        load_texture_words(at + 4u), load_texture_words(at + 5u), load_texture_words(at + 6u),
        load_texture_words(at + 7u), load_texture_words(at + 8u), load_texture_words(at + 9u),
        load_float(at + 10u), load_float(at + 11u), load_float(at + 12u), load_float(at + 13u),
        load_texture_words(at + 14u), load_float(at + 15u)
    );
}

// `MaterialMaps.flags` of a material.
uint map_flags_of(uint material_ix) {
    return load_texture_words(accel.material_maps_begin + 16u * material_ix + 14u);
}

// Texture coordinates of a corner of a triangle, 0..2.
vec2 corner_uv(uint triangle_ix, uint uv_set, uint corner) {
    uint entry = uv_set * accel.n_triangles + row_of(triangle_ix);
    uint at = accel.uvs_begin + 6u * entry + 2u * stored_corner(corner);
    return vec2(load_float(at), load_float(at + 1u));
}

// Texture coordinates at barycentric weights; 0 if the scene has none.
vec2 uv_at(uint triangle_ix, uint uv_set, float u, float v) {
    if (accel.uvs_begin == NO_WORDS) return vec2(0.0);
    return (1.0 - u - v) * corner_uv(triangle_ix, uv_set, 0u) + u * corner_uv(triangle_ix, uv_set, 1u)
        + v * corner_uv(triangle_ix, uv_set, 2u);
}

CornerSurface corner_surface(uint triangle_ix, uint corner) {
    uint at = accel.corners_begin + 6u * row_of(triangle_ix) + 2u * stored_corner(corner);
    return CornerSurface(placed_tangent(load_texture_words(at)), load_texture_words(at + 1u));
}

// A colour of 8 bits a channel, with sRGB decoded.
vec4 decode_colour(uint colour) {
    return vec4(
        load_float(colour & 255u), load_float((colour >> 8) & 255u), load_float((colour >> 16) & 255u),
        float(colour >> 24) * (1.0 / 255.0)
    );
}

// The interpolated colour of the corners; white if the scene has none.
vec4 corner_colour_at(uint triangle_ix, float u, float v) {
    if (accel.corners_begin == NO_WORDS) return vec4(1.0);
    return (1.0 - u - v) * decode_colour(corner_surface(triangle_ix, 0u).colour)
        + u * decode_colour(corner_surface(triangle_ix, 1u).colour)
        + v * decode_colour(corner_surface(triangle_ix, 2u).colour);
}

#endif
