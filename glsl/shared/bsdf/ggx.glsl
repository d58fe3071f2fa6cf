// Distribution and visibility of the normals of microfacets: GGX. Directions are in the frame of the surface. Twin of
// src/reference/bsdf/ggx.rs.
//
// - The distribution is that of Walter et al. (Microfacet Models for Refraction through Rough Surfaces, EGSR 2007).
// - Masking and shadowing are Smith's, correlated in height (Heitz: Understanding the Masking-Shadowing Function,
//   JCGT 2014).
// - Normals are sampled in proportion to their area as the viewer sees it (Heitz: Sampling the GGX Distribution of
//   Visible Normals, JCGT 2018), by spherical caps (Dupuy, Benyoub: Sampling Visible GGX Normals with Spherical Caps,
//   HPG 2023).
//
// width: of the distribution, at least LEAST_ROUGH_WIDTH. Cosines: to the surface's normal, above 0.
#ifndef KDRAY_BSDF_GGX
#define KDRAY_BSDF_GGX

#include "constants.glsl"

// Pdf of normals, per steradian and area of the surface. half_vector.z is at least 0.
float ggx_distribution(vec3 half_vector, float width) {
    float squared = width * width;
    float spread = dot(half_vector.xy, half_vector.xy) + half_vector.z * half_vector.z * squared;
    return squared / (PI * spread * spread);
}

// The part of Smith's terms that depends on one direction: its cosine, times 1 + 2 Lambda.
float ggx_root(float cosine, float width) {
    float squared = width * width;
    return sqrt(cosine * cosine * (1.0 - squared) + squared);
}

// Pdf of visible normals per steradian, divided by the cosine between the viewer and the normal.
float ggx_visible_pdf(vec3 to_viewer, vec3 half_vector, float width) {
    return ggx_distribution(half_vector, width) * 2.0 / (to_viewer.z + ggx_root(to_viewer.z, width));
}

// Masking and shadowing together, divided by the viewer's cosine. cos_light: unsigned.
float ggx_visibility(float cos_viewer, float cos_light, float width) {
    float sum = cos_light * ggx_root(cos_viewer, width) + cos_viewer * ggx_root(cos_light, width);
    return 2.0 * cos_light / sum;
}

// A visible normal.
vec3 sample_ggx(vec3 to_viewer, float width, vec2 u) {
    vec3 stretched = normalize(vec3(width * to_viewer.xy, to_viewer.z));
    float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    float sine = sqrt(clamp(1.0 - z * z, 0.0, 1.0)), azimuth = 2.0 * PI * u.x;
    vec3 normal = vec3(sine * cos(azimuth), sine * sin(azimuth), z) + stretched;
    return normalize(vec3(width * normal.xy, max(normal.z, 0.0)));
}

#endif
