// What the passes of the noise filter `edge` have in common: the light on the surface that a pixel shows, and how alike
// the surfaces of two pixels are. Twin of src/reference/edge.rs. Needs nothing; provides the functions below.
#ifndef KDRAY_EDGE
#define KDRAY_EDGE

#include "layout.glsl"
#include "picture/noise.glsl"

// The albedo below which a colour of a surface counts as black.
#define LEAST_ALBEDO 1.0e-4
// Plane-distance falloff: the weight is 1 / e where the neighbour is seen at this sine above the pixel's tangent plane.
#define PLANE_SINE 0.2
// The squared distance of two mean normals at which the weight has fallen to 1 / e.
#define NORMAL_DISTANCE 0.0625
// What is subtracted from this distance if the pixel's own normals differ, as a multiple of their variance. Then a
// pixel on an edge gets light from both sides if its samples are on both sides, up to one in four.
#define NORMAL_VARIANCES 3.0

// The light that surfaces scatter to the camera, divided by their albedo. radiance: of the pixel.
vec3 light_on(vec3 radiance, Auxiliary aux) {
    vec3 scattered = max(radiance - aux.seen, 0.0);
    return mix(vec3(0.0), scattered / max(aux.albedo, LEAST_ALBEDO), greaterThan(aux.albedo, vec3(LEAST_ALBEDO)));
}

// A vector of unit length, or 0 if the vector has none.
vec3 direction_of(vec3 vector) {
    float squared = dot(vector, vector);
    return squared > 0.0 ? vector * inversesqrt(squared) : vec3(0.0);
}

// How much the light of pixel b tells of that on the surface of pixel a, from what both show. Pixels of low albedo tell
// less, because the division by the albedo increases their noise.
float surface_weight(Auxiliary a, Auxiliary b) {
    if (a.n_hits == 0u || b.n_hits == 0u) return 0.0;
    vec3 apart = a.normal_world - b.normal_world;
    float own_variance = max(1.0 - dot(a.normal_world, a.normal_world), 0.0);
    float turned = max(dot(apart, apart) - NORMAL_VARIANCES * own_variance, 0.0);
    float sine = abs(dot(direction_of(a.normal_world), direction_of(b.position_world - a.position_world)));
    return luminance_of(b.albedo) * exp(-turned / NORMAL_DISTANCE - sine / PLANE_SINE);
}

#endif
