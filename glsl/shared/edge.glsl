// What the passes of the noise filter `edge` have in common: the light on the surface that a pixel shows, and how alike
// the surfaces of two pixels are. Twin of src/reference/edge.rs. Needs nothing; provides the functions below.
#ifndef KDRAY_EDGE
#define KDRAY_EDGE

#include "layout.glsl"
#include "noise.glsl"

// The albedo below which a colour of a surface counts as black.
#define LEAST_ALBEDO 1.0e-4
// The sine of the angle between a pixel's surface and the straight line to another pixel's point at which the weight of
// the other pixel has fallen to 1 / e.
#define PLANE_SINE 0.2
// The exponent of the cosine between two normals is 2 to the power of this.
#define NORMAL_EXPONENT_LOG2 5u

// The light that surfaces scatter to the camera, divided by their albedo. radiance: of the pixel.
vec3 light_on(vec3 radiance, Guide guide) {
    vec3 scattered = max(radiance - guide.seen, 0.0);
    return mix(vec3(0.0), scattered / max(guide.albedo, LEAST_ALBEDO), greaterThan(guide.albedo, vec3(LEAST_ALBEDO)));
}

// A vector of unit length, or 0 if the vector has none.
vec3 direction_of(vec3 vector) {
    float squared = dot(vector, vector);
    return squared > 0.0 ? vector * inversesqrt(squared) : vec3(0.0);
}

// How much the light of pixel b tells of that on the surface of pixel a, from what both show. Pixels of low albedo tell
// less, because the division by the albedo increases their noise.
float surface_weight(Guide a, Guide b) {
    if (a.n_hits == 0u || b.n_hits == 0u) return 0.0;
    vec3 normal = direction_of(a.normal_world);
    float cosine = clamp(dot(normal, direction_of(b.normal_world)), 0.0, 1.0);
    for (uint i = 0u; i < NORMAL_EXPONENT_LOG2; ++i) cosine *= cosine;
    float sine = abs(dot(normal, direction_of(b.position_world - a.position_world)));
    return luminance_of(b.albedo) * cosine * exp(-sine / PLANE_SINE);
}

#endif
