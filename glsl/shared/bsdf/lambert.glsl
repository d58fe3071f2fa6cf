// Diffuse reflection (Lambert: Photometria, 1760): the same radiance in all directions. Directions are in the frame of
// the surface. Twin of src/reference/bsdf/lambert.rs.
#ifndef KDRAY_BSDF_LAMBERT
#define KDRAY_BSDF_LAMBERT

#include "constants.glsl"

// A direction with a pdf in proportion to its cosine: a uniform point of the disk, raised to the hemisphere
// (Malley's method; Pharr et al.: Physically Based Rendering, 4th edition, A.5.3).
vec3 sample_lambert(vec2 u) {
    float radius = sqrt(u.x), azimuth = 2.0 * PI * u.y;
    return vec3(radius * cos(azimuth), radius * sin(azimuth), sqrt(max(1.0 - u.x, 0.0)));
}

float lambert_pdf(vec3 to_light) {
    return max(to_light.z, 0.0) / PI;
}

// The reflectance towards any viewer, times the cosine.
vec3 evaluate_lambert(vec3 reflectance, vec3 to_light) {
    return reflectance * (max(to_light.z, 0.0) / PI);
}

#endif
