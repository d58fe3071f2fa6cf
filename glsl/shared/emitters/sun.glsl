// Directional lights that are seen as disks: parts of the environment. Twin of src/reference/emitters/sun.rs.
//
// Needs the words of textures (shading/texture_words.glsl).
#ifndef KDRAY_SUN
#define KDRAY_SUN

#include "layout.glsl"
#include "emitters/kinds.glsl"
#include "emitters/light_sample.glsl"
#include "emitters/area_light.glsl"

// What the suns add to the environment in a direction. pdf: with which sample_light samples the direction because of
// the suns, per steradian.
struct SeenSuns {
    vec3 radiance;
    float pdf;
};

SeenSuns seen_suns(vec3 direction) {
    SeenSuns seen = SeenSuns(vec3(0.0), 0.0);
    if (!has_emitters(EMITTER_SUN)) return seen;
    for (uint i = 0u; i < accel.n_suns; ++i) {
        AreaLight sun = area_light_at(accel.n_area_lights + i);
        // The squared distance of two unit vectors is twice 1 - cos. It keeps small angles exact.
        vec3 aside = direction - sun.position;
        if (dot(aside, aside) > 2.0 * sun.radius) continue;
        seen.radiance += sun.radiance;
        seen.pdf += sun.probability / sun.area;
    }
    return seen;
}

// A direction, uniform in the disk of a sun.
vec3 sun_direction(uint sun_ix, vec2 u) {
    AreaLight sun = area_light_at(accel.n_area_lights + sun_ix);
    float versine = u.x * sun.radius;
    float sine = sqrt(versine * (2.0 - versine));
    return around(sun.position, sun.edge_u, sun.edge_v, vec3(1.0 - versine, sine, u.y));
}

#endif
