// Lookups in textures, whose texels are words of the array `texels`. Positions within an image and weights of texels
// are multiples of 1/256, so all devices blend alike. Twin of src/world/texture.rs.
//
// Needs load_texels(uint) -> uint, a word of the array `texels`.
#ifndef KDRAY_TEXTURE
#define KDRAY_TEXTURE

#include "layout.glsl"
#include "integrator.glsl"

// Which of a triangle's sets of texture coordinates the texture uses, 0 or 1.
uint uv_set_of(Texture map) {
    return (map.flags & TEXTURE_UV_SET) != 0u ? 1u : 0u;
}

// Width and height of a mip level, texels.
uvec2 size_of_mip(Texture map, uint mip) {
    return max(uvec2(map.size & 0xffffu, map.size >> 16u) >> mip, uvec2(1u));
}

// The wrap along an axis, `WRAP_REPEAT` and its like. shift: TEXTURE_WRAP_U_SHIFT or TEXTURE_WRAP_V_SHIFT.
uint wrap_of(Texture map, uint shift) {
    return (map.flags >> shift) & TEXTURE_WRAP_MASK;
}

// A texel: linear colour, and opacity.
vec4 texel(Texture map, uint mip, uint x, uint y) {
    uint texel_ix = y * size_of_mip(map, mip).x + x;
    uint first = load_texels(map.first_texel + mip);
    if ((map.flags & TEXTURE_HALVES) != 0u) {
        uint word_ix = first + 2u * texel_ix;
        return vec4(unpackHalf2x16(load_texels(word_ix)), unpackHalf2x16(load_texels(word_ix + 1u)));
    }
    uint word = load_texels(first + texel_ix);
    uvec4 bytes = uvec4(word & 255u, (word >> 8u) & 255u, (word >> 16u) & 255u, word >> 24u);
    vec4 linear = vec4(bytes) * (1.0 / 255.0);
    if ((map.flags & TEXTURE_SRGB) == 0u) return linear;
    vec3 colour = uintBitsToFloat(uvec3(load_texels(bytes.x), load_texels(bytes.y), load_texels(bytes.z)));
    return vec4(colour, linear.w);
}

// The coordinate within one period of the image: 0..2 if every second copy is mirrored, otherwise 0..1.
float folded(float coordinate, uint wrap) {
    const float most = TEXTURE_MAX_COORDINATE;
    // NaN becomes 0.
    float bounded = coordinate > 0.0 ? min(coordinate, most) : (coordinate < 0.0 ? max(coordinate, -most) : 0.0);
    if (wrap == WRAP_CLAMP) return clamp(bounded, 0.0, 1.0);
    if (wrap == WRAP_MIRROR) return bounded - 2.0 * floor(0.5 * bounded);
    return bounded - floor(bounded);
}

// The column or row of an image of n that is shown at an index. index: at most one outside of the period.
uint wrapped(int index, uint n, uint wrap) {
    int size = int(n);
    int period = wrap == WRAP_MIRROR ? 2 * size : size;
    if (wrap == WRAP_CLAMP) {
        index = clamp(index, 0, size - 1);
    } else {
        if (index < 0) index += period;
        if (index >= period) index -= period;
        if (index >= size) index = period - 1 - index;
    }
    // This holds anyway. It keeps the index in range on devices that have other rules for NaN.
    return min(uint(index), n - 1u);
}

// The colour of a mip level at a place. place: coordinates to which the texture's transform has been applied already.
vec4 sample_mip(Texture map, uint mip, vec2 place) {
    uvec2 size = size_of_mip(map, mip);
    uint wrap_u = wrap_of(map, TEXTURE_WRAP_U_SHIFT);
    uint wrap_v = wrap_of(map, TEXTURE_WRAP_V_SHIFT);
    precise vec2 at = vec2(folded(place.x, wrap_u), folded(place.y, wrap_v)) * vec2(size);
    bool is_nearest = (map.flags & TEXTURE_NEAREST) != 0u;
    // The centre of the first texel is 0.
    ivec2 steps = is_nearest ? ivec2(floor(at)) << 8 : ivec2(floor(at * 256.0 + 0.5)) - 128;
    ivec2 low = steps >> 8;
    vec2 weight = vec2(steps & 255) * (1.0 / 256.0);
    // The texels are looked up in a loop: each copy of the lookup would make all kernels longer.
    vec4 texels[4];
    for (int i = 0; i < 4; ++i) {
        ivec2 high = is_nearest ? ivec2(0) : ivec2(i & 1, i >> 1);
        uint x = wrapped(low.x + high.x, size.x, wrap_u);
        uint y = wrapped(low.y + high.y, size.y, wrap_v);
        texels[i] = texel(map, mip, x, y);
    }
    vec4 upper = texels[0] + (texels[1] - texels[0]) * weight.x;
    vec4 lower = texels[2] + (texels[3] - texels[2]) * weight.x;
    return upper + (lower - upper) * weight.y;
}

// The texture's value in its mip 0.
vec4 sample_finest(Texture map, vec2 uv) {
    precise float u = map.m00 * uv.x + map.m01 * uv.y + map.offset_u;
    precise float v = map.m10 * uv.x + map.m11 * uv.y + map.offset_v;
    return sample_mip(map, 0u, vec2(u, v));
}

// The linear colour and the opacity of a texture. lod: the mip level, of which a fraction blends two mip levels. It is
// bounded to the texture's mip levels, and NaN is 0.
vec4 sample_texture(Texture map, vec2 uv, float lod) {
    precise float u = map.m00 * uv.x + map.m01 * uv.y + map.offset_u;
    precise float v = map.m10 * uv.x + map.m11 * uv.y + map.offset_v;
    uint steps = lod > 0.0 ? uint(min(lod, float(map.n_mips - 1u)) * 256.0 + 0.5) : 0u;
    uint mip = steps >> 8u;
    float share = float(steps & 255u) * (1.0 / 256.0);
    // Where the share is 0, the second mip level need not exist. Paths leave its iteration of the loop out there.
    // Whitted's shadow rays are 7 % faster with two iterations in any case, which the driver unrolls.
    bool needs_one = share == 0.0;
    uint n_turns = PATHS && needs_one ? 1u : 2u;
    vec4 mips[2];
    for (uint i = 0u; i < n_turns; ++i) {
        mips[i] = i == 0u || !needs_one ? sample_mip(map, mip + i, vec2(u, v)) : mips[0];
    }
    if (needs_one) return mips[0];
    return mips[0] + (mips[1] - mips[0]) * share;
}

// The number that a texture of one number shows. value: from sample_texture.
float scalar_of(Texture map, vec4 value) {
    uint channel = (map.flags >> TEXTURE_CHANNEL_SHIFT) & TEXTURE_CHANNEL_MASK;
    if (channel == CHANNEL_LUMINANCE) return 0.2126 * value.x + 0.7152 * value.y + 0.0722 * value.z;
    return value[min(channel, CHANNEL_ALPHA)];
}

#endif
