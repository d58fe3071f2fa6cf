// Triangles whose material emits light, to both sides. A point is sampled uniformly on the area. Twin of
// src/reference/emitters/triangle.rs.
//
// Needs the binding `materials` (shading/material.glsl) and the words of textures.
#ifndef KDRAY_EMITTING_TRIANGLE
#define KDRAY_EMITTING_TRIANGLE

#include "layout.glsl"
#include "scene.glsl"
#include "shading/texture_words.glsl"
#include "shading/texture.glsl"
#include "shading/material.glsl"
#include "emitters/light_sample.glsl"

// The radiance that a triangle emits at barycentric weights of its second and third corner, by mip level 0 of
// its texture. A surface without shading (`unlit`) emits nothing.
vec3 emission_at(uint triangle_ix, float u, float v) {
    uint material_ix = material_ix_of(triangle_ix);
    if ((materials[material_ix].flags & MATERIAL_UNLIT) != 0u) return vec3(0.0);
    vec3 emitted = materials[material_ix].ke;
    bool has_maps = TEXTURED ? accel.material_maps_begin != NO_WORDS : false;
    if (!has_maps) return emitted;
    uint texture_ix = maps_of(material_ix).emission;
    if (texture_ix == NO_TEXTURE) return emitted;
    Texture map = texture_at(texture_ix);
    return emitted * max(sample_finest(map, uv_at(triangle_ix, uv_set_of(map), u, v)).rgb, 0.0);
}

// Pdf per steradian of a direction in which the triangle is seen at a distance, if its points are sampled uniformly.
float area_pdf(Triangle t, vec3 direction, float distance) {
    // Twice the area, times the cosine.
    float facing = abs(dot(cross(t.v1 - t.v0, t.v2 - t.v0), direction));
    float pdf = 2.0 * distance * distance / facing;
    return pdf < MOST_LIGHT ? pdf : 0.0;
}

// Barycentric weights of a triangle's second and third corner, uniform on its area (Heitz: A Low-Distortion Map Between
// Triangle and Square, 2019).
vec2 triangle_weights(vec2 u) {
    return u.y > u.x ? vec2(0.5 * u.x, u.y - 0.5 * u.x) : vec2(u.x - 0.5 * u.y, 0.5 * u.y);
}

// probability: with which this triangle is sampled.
LightSample sample_triangle(uint triangle_ix, vec3 point_world, vec2 u, float probability) {
    Triangle t = triangle_at(triangle_ix);
    vec2 weights = triangle_weights(u);
    vec3 point = t.v0 + weights.x * (t.v1 - t.v0) + weights.y * (t.v2 - t.v0);
    Towards way = towards(point_world, point);
    float pdf = probability * area_pdf(t, way.direction, way.distance);
    return sample_of_point(way, emission_at(triangle_ix, weights.x, weights.y), pdf);
}

#endif
