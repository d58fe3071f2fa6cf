#ifndef KDRAY_TEXTURE
#define KDRAY_TEXTURE
#include "layout.glsl"
#include "texture_words.glsl"
uint uv_set_of(Texture t) { return (t.flags >> 4) & 1u; }
vec4 sample_texture(Texture t, vec2 uv, float lod) { return vec4(uv, lod, float(load_texels(t.first_texel))); }
float scalar_of(Texture t, vec4 v) { return v.r; }
#endif
