// The child rays that start at a hit: reflected, transmitted, both or none. Twin of src/reference/children.rs.
#ifndef KDRAY_CHILDREN
#define KDRAY_CHILDREN

#include "layout.glsl"
#include "scene.glsl"
#include "surface.glsl"
#include "material.glsl"

// Whether a child ray of this weight has a throughput above 0 in any colour.
bool carries_light(PathRay ray, vec3 weight) {
    return any(greaterThan(ray.throughput * weight, vec3(0.0)));
}

// The ray's children that carry light, as bits CHILD_*.
uint child_kinds_of(PathRay ray, Hit hit) {
    if (hit.triangle_ix == NO_TRIANGLE || !scatters_light(material_at(hit))) return 0u;
    Surface surface = surface_at(ray, hit, triangle_at(hit.triangle_ix));
    Scattering next = scatter(material_at(hit), surface, ray.direction);
    return (carries_light(ray, next.reflected_weight) ? CHILD_REFLECTED : 0u)
         | (carries_light(ray, next.transmitted_weight) ? CHILD_TRANSMITTED : 0u);
}

#endif
