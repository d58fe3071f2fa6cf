// A clear coat above a surface, of the index of refraction 1.5 (KHR_materials_clearcoat), whose microfacets reflect as
// those of reflection.glsl do. What the coat reflects towards the viewer is missing below it. Twin of
// src/reference/bsdf/clearcoat.rs.
#ifndef KDRAY_BSDF_CLEARCOAT
#define KDRAY_BSDF_CLEARCOAT

#include "shading/microfacet.glsl"
#include "bsdf/albedo.glsl"

// Reflectance along the normal, of the index 1.5.
const float CLEARCOAT_REFLECTANCE = 0.04;

float clearcoat_fresnel(float cosine) {
    return mix(CLEARCOAT_REFLECTANCE, 1.0, grazing_weight(cosine));
}

// The share of light that a whole coat reflects. roughness: as in `ggx_albedo`.
float clearcoat_albedo(float cosine, float roughness) {
    GgxAlbedo albedo = ggx_albedo(cosine, roughness);
    return CLEARCOAT_REFLECTANCE * (1.0 - albedo.loss - albedo.grazing) + albedo.grazing;
}

#endif
