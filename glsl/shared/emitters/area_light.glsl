// Rectangles, disks and spheres, which are no part of the acceleration structure. Twin of
// src/reference/emitters/area_light.rs.
//
// Needs the words of textures (shading/texture_words.glsl).
#ifndef KDRAY_AREA_LIGHT
#define KDRAY_AREA_LIGHT

#include "layout.glsl"
#include "shading/texture_words.glsl"
#include "emitters/kinds.glsl"
#include "emitters/light_sample.glsl"
#include "emitters/rectangle.glsl"
#include "emitters/disk.glsl"
#include "emitters/sphere.glsl"
#include "emitters/tree.glsl"

// What a ray sees of the area lights. t: distance of the nearest one, infinity if it meets none. pdf: with which
// sample_light samples the direction, per steradian.
struct SeenLight {
    float t;
    vec3 radiance;
    float pdf;
};

vec3 load_vector(uint at) {
    return vec3(load_float(at), load_float(at + 1u), load_float(at + 2u));
}

// An area light or, behind the last one, a sun.
AreaLight area_light_at(uint light_ix) {
    uint at = accel.area_lights_begin + 20u * light_ix;
    return AreaLight(
        load_vector(at), load_texture_words(at + 3u), load_vector(at + 4u), load_float(at + 7u),
        load_vector(at + 8u), load_float(at + 11u), load_vector(at + 12u), load_float(at + 15u),
        load_vector(at + 16u), load_texture_words(at + 19u)
    );
}

// Distance at which a ray meets an area light, world units; infinity if it does not. direction: a unit vector.
float hit_area_light(AreaLight light, vec3 origin, vec3 direction) {
    if (has_shapes(AREA_RECTANGLE) && light.kind == AREA_RECTANGLE) return hit_rectangle(light, origin, direction);
    if (has_shapes(AREA_DISK) && light.kind == AREA_DISK) return hit_disk(light, origin, direction);
    if (has_shapes(AREA_SPHERE)) return hit_sphere(light, origin, direction);
    return INFINITY;
}

// The pdf with which a sample of the light gives the direction in which it is hit at a distance, per steradian.
float shape_pdf(AreaLight light, vec3 origin, vec3 direction, float distance) {
    if (has_shapes(AREA_RECTANGLE) && light.kind == AREA_RECTANGLE) {
        return rectangle_pdf(light, origin, direction, distance);
    }
    if (has_shapes(AREA_DISK) && light.kind == AREA_DISK) return flat_pdf(light, direction, distance);
    return has_shapes(AREA_SPHERE) ? sphere_pdf(light, origin) : 0.0;
}

// The nearest rectangle, disk or sphere that the ray meets between 0 and t_max. direction: a unit vector. The backs of
// rectangles and disks and the insides of spheres are not seen.
SeenLight seen_light(vec3 origin, vec3 direction, float t_max) {
    float nearest = INFINITY;
    if (!has_emitters(EMITTER_AREA)) return SeenLight(nearest, vec3(0.0), 0.0);
    uint nearest_ix = 0u;
    for (uint light_ix = 0u; light_ix < accel.n_area_lights; ++light_ix) {
        float t = hit_area_light(area_light_at(light_ix), origin, direction);
        if (t < nearest && t < t_max) {
            nearest = t;
            nearest_ix = light_ix;
        }
    }
    if (isinf(nearest)) return SeenLight(nearest, vec3(0.0), 0.0);
    AreaLight light = area_light_at(nearest_ix);
    float probability = light.probability;
    if (has_emitters(EMITTER_TREE)) probability *= tree_probability(origin, light.leaf_ix);
    return SeenLight(nearest, light.radiance, probability * shape_pdf(light, origin, direction, nearest));
}

// probability: with which this light is sampled.
LightSample sample_area_light(uint light_ix, vec3 point_world, vec2 u, float probability) {
    AreaLight light = area_light_at(light_ix);
    light.probability = probability;
    if (has_shapes(AREA_RECTANGLE) && light.kind == AREA_RECTANGLE) return sample_rectangle(light, point_world, u);
    if (has_shapes(AREA_DISK) && light.kind == AREA_DISK) return sample_disk(light, point_world, u);
    if (has_shapes(AREA_SPHERE)) return sample_sphere(light, point_world, u);
    return no_sample();
}

#endif
