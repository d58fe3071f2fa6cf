// The surface and the material at a hit, with the material's textures applied. Twin of src/reference/maps.rs.
//
// A ray from the camera widens to a cone, whose width at a hit selects the mip level of a texture (Akenine-Möller et
// al.: Texture Level of Detail Strategies for Real-Time Ray Tracing, Ray Tracing Gems, 2019). The cone is as wide as a
// pixel of the image plane, times the length of the path from the eye. Of a path with more than one reflection or
// refraction, the straight distance to the last one stands for the length up to there. The rays of an orthographic
// camera do not widen: they are as wide as a pixel everywhere.
#ifndef KDRAY_MAPS
#define KDRAY_MAPS

#include "layout.glsl"
#include "frame.glsl"
#include "scene.glsl"
#include "shading/surface.glsl"
#include "shading/material.glsl"
#include "shading/alpha_test.glsl"

// A hit, as textures are looked up at it.
struct TextureHit {
    uint triangle_ix;
    float u;
    float v;
    // Base-2 logarithm of the cone's width on the surface, divided by the square root of twice the triangle's area.
    float log_width;
};

// Width of the ray's cone at its hit, world units.
float cone_width(PathRay ray, Hit hit) {
    float pixel = 2.0 * length(frame.up) / float(frame.picture_height);
    if (ORTHOGRAPHIC) return pixel;
    return pixel * (distance(ray.origin, frame.eye) + hit.t);
}

TextureHit texture_hit(PathRay ray, Hit hit, Triangle t, Surface surface) {
    // The edges are scaled to about 1, since the cross product of a tiny triangle would underflow.
    vec3 e1 = t.v1 - t.v0, e2 = t.v2 - t.v0;
    float scale = 1.0 / max(largest_of(abs(e1)), largest_of(abs(e2)));
    float doubled_area = length(cross(e1 * scale, e2 * scale));
    float cosine = max(abs(dot(ray.direction, surface.geometric)), LEAST_COSINE);
    float log_width = log2(cone_width(ray, hit) * scale / cosine) - 0.5 * log2(doubled_area);
    return TextureHit(hit.triangle_ix, hit.u, hit.v, log_width);
}

// The mip level of a texture whose texels are as large as the cone on the surface.
float mip_of(Texture map, TextureHit hit) {
    uint uv_set = uv_set_of(map);
    vec2 a = corner_uv(hit.triangle_ix, uv_set, 0u);
    vec2 e1 = corner_uv(hit.triangle_ix, uv_set, 1u) - a, e2 = corner_uv(hit.triangle_ix, uv_set, 2u) - a;
    float scale = abs(map.m00 * map.m11 - map.m01 * map.m10);
    float n_texels = abs(e1.x * e2.y - e1.y * e2.x) * scale * float(map.size & 0xffffu) * float(map.size >> 16);
    // Texture coordinates without area say nothing about the size of texels.
    return n_texels > 0.0 ? hit.log_width + 0.5 * log2(n_texels) : 0.0;
}

vec4 map_at(uint texture_ix, TextureHit hit) {
    Texture map = texture_at(texture_ix);
    if (accel.uvs_begin == NO_WORDS) return sample_texture(map, vec2(0.0), 0.0);
    return sample_texture(map, uv_at(hit.triangle_ix, uv_set_of(map), hit.u, hit.v), mip_of(map, hit));
}

// The places of the material's textures, as bits.
uint places_of(MaterialMaps maps) {
    return (maps.base_colour != NO_TEXTURE ? 1u << MAP_BASE_COLOUR : 0u)
        | (maps.opacity != NO_TEXTURE ? 1u << MAP_OPACITY : 0u)
        | (maps.specular != NO_TEXTURE ? 1u << MAP_SPECULAR : 0u)
        | (maps.specular_factor != NO_TEXTURE ? 1u << MAP_SPECULAR_FACTOR : 0u)
        | (maps.emission != NO_TEXTURE ? 1u << MAP_EMISSION : 0u)
        | (maps.normal != NO_TEXTURE ? 1u << MAP_NORMAL : 0u)
        | (maps.roughness != NO_TEXTURE ? 1u << MAP_ROUGHNESS : 0u)
        | (maps.metallic != NO_TEXTURE ? 1u << MAP_METALLIC : 0u)
        | (maps.transmission != NO_TEXTURE ? 1u << MAP_TRANSMISSION : 0u)
        | (maps.occlusion != NO_TEXTURE ? 1u << MAP_OCCLUSION : 0u);
}

// The values of a material's textures, in the order of `MaterialMaps`: a colour with opacity, or the number of a
// texture of one number in all components. A texture that is missing has 1. They are looked up in a loop, since each
// copy of the lookup would make every kernel that shades longer by a thousand instructions. The loop has a turn for
// each texture that is there, since some drivers run the lookup in each turn, needed or not.
vec4[N_MAPS] map_values(MaterialMaps maps, uint material_ix, TextureHit hit) {
    vec4 values[N_MAPS];
    for (uint i = 0u; i < N_MAPS; ++i) values[i] = vec4(1.0);
    for (uint left = places_of(maps); left != 0u; left &= left - 1u) {
        uint i = uint(findLSB(left));
        uint texture_ix = load_texture_words(accel.material_maps_begin + 16u * material_ix + i);
        vec4 value = map_at(texture_ix, hit);
        bool is_colour = i == MAP_BASE_COLOUR || i == MAP_SPECULAR || i == MAP_EMISSION || i == MAP_NORMAL;
        values[i] = is_colour ? value : vec4(scalar_of(texture_at(texture_ix), value));
    }
    return values;
}

// Adds a corner's tangent, weighted.
void add_tangent(uint code, float weight, inout vec3 tangent, inout float side) {
    tangent += weight * decode_normal(code & ~1u);
    side = (code & 1u) != 0u ? 1.0 : -1.0;
}

// The shading normal that the value of the normal map gives, on the side of the interpolated normal. Without tangents,
// it is the interpolated normal.
vec3 mapped_normal(MaterialMaps maps, vec4 value, TextureHit hit, Surface surface) {
    if (maps.normal == NO_TEXTURE || accel.corners_begin == NO_WORDS) return surface.interpolated;
    vec3 tangent = vec3(0.0);
    float side = 1.0;
    vec3 weights = vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
    for (uint corner = 0u; corner < 3u; ++corner) {
        uint code = corner_surface(hit.triangle_ix, corner).tangent;
        if (code == FLAT_NORMAL) return surface.interpolated;
        add_tangent(code, weights[corner], tangent, side);
    }
    // Seen from behind, the interpolated normal is reversed; the tangent frame belongs to the front.
    float front = surface.is_reversed ? -1.0 : 1.0;
    vec3 normal = front * surface.interpolated;
    tangent -= dot(tangent, normal) * normal;
    float squared = dot(tangent, tangent);
    if (!(squared > LEAST_NORMAL_SQUARED)) return surface.interpolated;
    tangent *= inversesqrt(squared);
    vec3 bitangent = side * cross(normal, tangent);
    vec3 map = 2.0 * value.xyz - 1.0;
    map.z = max(map.z, 0.0);
    vec3 bent = maps.normal_scale * (map.x * tangent + map.y * bitangent) + map.z * normal;
    float length_squared = dot(bent, bent);
    return length_squared > LEAST_NORMAL_SQUARED ? front * bent * inversesqrt(length_squared) : surface.interpolated;
}

// Multiplies the material's terms by its textures and by the colours of the triangle's corners. Images of floats can
// have any values, which are bounded to those that make sense.
void apply_maps(MaterialMaps maps, vec4 values[N_MAPS], TextureHit hit, inout Material material) {
    vec4 corner_colour = corner_colour_at(hit.triangle_ix, hit.u, hit.v);
    vec4 map_colour = values[MAP_BASE_COLOUR];
    vec3 base = corner_colour.rgb * max(map_colour.rgb, 0.0);
    material.kd *= base;
    // What is left of a masked surface is opaque.
    if ((maps.flags & MAPS_ALPHA_MASK) == 0u) {
        if ((maps.flags & MAPS_CORNERS_HAVE_OPACITY) != 0u) material.d *= corner_colour.a;
        if ((maps.flags & MAPS_COLOUR_HAS_OPACITY) != 0u) material.d *= map_colour.a;
        material.d = clamp(material.d * values[MAP_OPACITY].x, 0.0, 1.0);
    }
    material.ks *= max(values[MAP_SPECULAR].rgb * values[MAP_SPECULAR_FACTOR].x, 0.0);
    material.ke *= max(values[MAP_EMISSION].rgb, 0.0);
    float rough = max(values[MAP_ROUGHNESS].x, 0.0);
    material.roughness = min(material.roughness * rough, 1.0);
    material.ns = max(material.ns * rough, 1.0);
    material.metallic *= clamp(values[MAP_METALLIC].x, 0.0, 1.0);
    material.transmission *= clamp(values[MAP_TRANSMISSION].x, 0.0, 1.0);
    material.ka *= 1.0 + maps.occlusion_strength * (clamp(values[MAP_OCCLUSION].x, 0.0, 1.0) - 1.0);
    if (!is_microfacet(material)) material.ka *= base;
}

// The squared tangent of an angle, from its cosine.
float squared_tangent(float cosine) {
    return max(1.0 - cosine * cosine, 0.0) / (cosine * cosine);
}

// Whether a normal map has bent the shading normal. It has not where a normal is not a number.
bool is_bent(Surface surface) {
    return TEXTURED && any(greaterThan(abs(surface.shading - surface.interpolated), vec3(0.0)));
}

// The share of a light that reaches a bent normal, whose bumps shadow one another: 1 from the direction of the
// interpolated normal, 0 at the horizon of the interpolated surface. The bumps are taken for microfacets of GGX, the
// rougher the more the normal is bent (Estevez, Lecocq, Stein: A Microfacet-Based Shadowing Function to Solve the Bump
// Terminator Problem, Ray Tracing Gems, 2019).
float bump_shadowing(Surface surface, vec3 to_light) {
    float share = 1.0;
    if (is_bent(surface)) {
        float cos_bend = max(abs(dot(surface.interpolated, surface.shading)), LEAST_COSINE);
        float cos_light = max(abs(dot(surface.interpolated, to_light)), LEAST_COSINE);
        float squared_width = min(0.125 * squared_tangent(cos_bend), 1.0);
        share = 2.0 / (1.0 + sqrt(1.0 + squared_width * squared_tangent(cos_light)));
    }
    return share;
}

// The material at a hit. If it has a normal map, the surface's shading normal becomes that of the map. t: the triangle
// that is hit.
Material material_at(PathRay ray, Hit hit, Triangle t, inout Surface surface) {
    uint material_ix = material_ix_of(hit.triangle_ix);
    Material material = materials[material_ix];
    if (TEXTURED) {
        MaterialMaps maps = maps_of(material_ix);
        TextureHit at = texture_hit(ray, hit, t, surface);
        vec4 values[N_MAPS] = map_values(maps, material_ix, at);
        apply_maps(maps, values, at, material);
        surface.shading = mapped_normal(maps, values[MAP_NORMAL], at, surface);
    }
    return material;
}

// The surface and its material at a ray's hit.
void shaded_at(PathRay ray, Hit hit, out Surface surface, out Material material) {
    Triangle t = triangle_at(hit.triangle_ix);
    surface = surface_at(ray, hit, t);
    material = material_at(ray, hit, t, surface);
}

#endif
