// The child rays that start at a hit: reflected, transmitted, both or none. Twin of src/reference/children.rs.
#ifndef KDRAY_CHILDREN
#define KDRAY_CHILDREN

#include "layout.glsl"
#include "scene.glsl"
#include "shading/surface.glsl"
#include "shading/material.glsl"
#include "shading/maps.glsl"

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
    return next;
}

// The ray's children that carry light, as bits CHILD_*.
uint child_kinds_of(PathRay ray, Hit hit) {
    if (hit.triangle_ix == NO_TRIANGLE) return 0u;
    // Textures may change what a material scatters.
    bool may_scatter = TEXTURED ? true : scatters_light(materials[load_triangle_materials(hit.triangle_ix)]);
    if (!may_scatter) return 0u;
    Surface surface;
    Scattering next = scattering_at(ray, hit, surface);
    return (next.reflected_weight != vec3(0.0) ? CHILD_REFLECTED : 0u)
         | (next.transmitted_weight != vec3(0.0) ? CHILD_TRANSMITTED : 0u);
}

#endif
