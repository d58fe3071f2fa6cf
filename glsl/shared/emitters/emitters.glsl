// The emitters of the path tracer: what a point of a surface may get light from. One emitter is sampled with a
// probability by its power or, where there are many, by what it may send to the point. Then a direction towards it is
// sampled. Twin of src/reference/emitters/mod.rs.
//
// Needs the bindings `lights` and `materials` (shading/material.glsl), and the words of textures.
#ifndef KDRAY_EMITTERS
#define KDRAY_EMITTERS

#include "layout.glsl"
#include "scene.glsl"
#include "shading/texture_words.glsl"
#include "emitters/alias.glsl"
#include "emitters/area_light.glsl"
#include "emitters/environment.glsl"
#include "emitters/kinds.glsl"
#include "emitters/light_sample.glsl"
#include "emitters/punctual.glsl"
#include "emitters/tree.glsl"
#include "emitters/triangle.glsl"

// The share of the way to a light within which another light hides it. What is beyond counts as the light itself.
const float LIGHT_HIDES_UP_TO = 0.9999;

Emitter emitter_at(uint emitter_ix) {
    uint at = accel.emitters_begin + 5u * emitter_ix;
    return Emitter(
        load_float(at), load_texture_words(at + 1u), load_float(at + 2u), load_texture_words(at + 3u),
        load_texture_words(at + 4u)
    );
}

// Samples a direction from which light may come to a point. u: in [0, 1); u.x selects the emitter. What hides the light
// is not asked, except for rectangles, disks and spheres, which only seen_light knows.
LightSample sample_light(vec3 point_world, vec3 u) {
    if (accel.n_emitters == 0u) return no_sample();
    // Tables of many entries need more bits than u.x has. The lowest bits of u.y hardly move the point that is sampled.
    float more = fract(u.y * 4096.0);
    AliasSample sampled = sample_alias(accel.emitters_begin, 5u, accel.n_emitters, u.x, more);
    Emitter emitter = emitter_at(sampled.ix);
    if (has_emitters(EMITTER_TREE) && emitter.kind == EMITTER_TREE) {
        TreeSample light = sample_in_tree(point_world, sampled.rest, more);
        emitter = emitter_at(light.emitter_ix);
        emitter.probability *= light.probability;
    }
    LightSample light_sample = no_sample();
    if (has_emitters(EMITTER_LIGHT) && emitter.kind == EMITTER_LIGHT) {
        light_sample = sample_punctual(lights[emitter.ix], point_world, emitter.probability);
    } else if (has_emitters(EMITTER_AREA) && emitter.kind == EMITTER_AREA) {
        light_sample = sample_area_light(emitter.ix, point_world, u.yz, emitter.probability);
    } else if (has_emitters(EMITTER_SUN) && emitter.kind == EMITTER_SUN) {
        light_sample = sample_sun(emitter.ix, u.yz);
    } else if (has_emitters(EMITTER_TRIANGLE) && emitter.kind == EMITTER_TRIANGLE) {
        light_sample = sample_triangle(emitter.ix, point_world, u.yz, emitter.probability);
    } else if (has_emitters(EMITTER_ENVIRONMENT)) {
        light_sample = sample_environment(u.yz);
    }
    if (!has_emitters(EMITTER_AREA)) return light_sample;
    SeenLight before = seen_light(point_world, light_sample.direction, LIGHT_HIDES_UP_TO * light_sample.distance);
    if (!isinf(before.t)) return no_sample();
    return light_sample;
}

// The pdf with which sample_light samples the point of a triangle that is seen from a point in a direction at a
// distance, per steradian; 0 for a triangle that is never sampled. direction: a unit vector.
float emission_pdf(uint triangle_ix, vec3 point_world, vec3 direction, float distance) {
    if (!has_emitters(EMITTER_TRIANGLE)) return 0.0;
    uint low = accel.first_triangle_emitter, end = low + accel.n_triangle_emitters;
    // The first entry whose triangle has this index or a larger one.
    uint high = end;
    while (low < high) {
        uint middle = low + (high - low) / 2u;
        if (load_texture_words(accel.emitters_begin + 5u * middle + 4u) < triangle_ix) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    if (low == end) return 0.0;
    Emitter emitter = emitter_at(low);
    if (emitter.ix != triangle_ix) return 0.0;
    if (has_emitters(EMITTER_TREE)) emitter.probability *= tree_probability(point_world, emitter.alias_ix);
    return emitter.probability * area_pdf(triangle_at(triangle_ix), direction, distance);
}

#endif
