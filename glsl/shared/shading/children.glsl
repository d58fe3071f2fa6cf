// The child rays that start at a hit: reflected, transmitted, both or none. Twin of src/reference/children.rs.
//
// A child is one deeper than its parent, unless it passes straight through a blended surface. The rays of a frame have
// no end, so `t_max` can say a ray's depth: as many floats lie between it and infinity. Without blended surfaces, the
// depth is the bounce, and `t_max` stays.
#ifndef KDRAY_CHILDREN
#define KDRAY_CHILDREN

#include "layout.glsl"
#include "scene.glsl"
#include "shading/surface.glsl"
#include "shading/material.glsl"
#include "shading/maps.glsl"

layout(constant_id = CONSTANT_BLENDED) const bool BLENDED = false;

// Whether the ray is at the last depth, and has no children that are deeper.
bool is_at_last_depth(PathRay ray) {
    uint n_used = floatBitsToUint(INFINITY) - floatBitsToUint(ray.t_max);
    return BLENDED && n_used + 1u >= frame.max_depth - frame.extra_bounces;
}

// The weight of a child ray, or 0 if its throughput is negligible in all colours. Only surfaces of microfacets have
// negligible children other than those without light: the model of MTL stays exact.
vec3 kept_weight(PathRay ray, Material material, vec3 weight) {
    float least = is_microfacet(material) ? LEAST_THROUGHPUT : 0.0;
    return any(greaterThan(ray.throughput * weight, vec3(least))) ? weight : vec3(0.0);
}

// How the ray continues from its hit.
Scattering scattering_at(PathRay ray, Hit hit, out Surface surface) {
    Material material;
    shaded_at(ray, hit, surface, material);
    Scattering next = scatter(material, surface, ray.direction);
    vec3 transmitted = transmittance(material, surface, hit.t);
    next.reflected_weight = kept_weight(ray, material, next.reflected_weight * transmitted);
    next.transmitted_weight = kept_weight(ray, material, next.transmitted_weight * transmitted);
    if (is_at_last_depth(ray)) {
        next.reflected_weight = vec3(0.0);
        if (!next.passes_straight) next.transmitted_weight = vec3(0.0);
    }
    return next;
}

// The child of a ray that leaves the surface of its hit in a direction.
PathRay child_ray(Surface surface, vec3 direction, Hit hit, PathRay ray, vec3 weight, bool is_deeper) {
    PathRay child = ray_from(surface, direction, hit.triangle_ix, ray, ray.throughput * weight);
    if (BLENDED && is_deeper) child.t_max = uintBitsToFloat(floatBitsToUint(ray.t_max) - 1u);
    return child;
}

// The ray's children that carry light, as bits CHILD_*.
uint child_flags_of(PathRay ray, Hit hit) {
    if (hit.triangle_ix == NO_TRIANGLE) return 0u;
    place(hit.triangle_ix);
    // Textures may change what a material scatters.
    bool may_scatter = TEXTURED ? true : scatters_light(materials[material_ix_of(hit.triangle_ix)]);
    if (!may_scatter) return 0u;
    Surface surface;
    Scattering next = scattering_at(ray, hit, surface);
    return (next.reflected_weight != vec3(0.0) ? CHILD_REFLECTED : 0u)
         | (next.transmitted_weight != vec3(0.0) ? CHILD_TRANSMITTED : 0u);
}

#endif
