// The light that bounces between microfacets more than once, and the light below a dielectric's microfacets (Kulla,
// Conty: Revisiting Physically Based Shading at Imageworks, SIGGRAPH 2017 courses). Twin of
// src/reference/bsdf/multiple_scattering.rs.
//
// A lobe that reflects the share 1 - q(V) of the light leaves a share q(V). A Lambertian lobe of the reflectance
// q(V) q(L) / mean(q) reflects just this share for each direction of view, and is reciprocal. mean: over the
// hemisphere, weighted by the cosine.
#ifndef KDRAY_BSDF_MULTIPLE_SCATTERING
#define KDRAY_BSDF_MULTIPLE_SCATTERING

// The mean of a Fresnel term F0 + (F90 - F0) (1 - cosine)^5.
vec3 mean_reflectance(vec3 at_normal, vec3 at_grazing) {
    return at_normal + (at_grazing - at_normal) / 21.0;
}

// The share that leaves the microfacets after more than one bounce, of the light that a first bounce does not bring
// out. It is the sum of a geometric series over bounces. In Kulla and Conty's formula, a bounce is missing, which the
// square adds (Turquin: Practical Multiple Scattering Compensation for Microfacet Models, 2019). reflectance: the mean
// one. loss: the mean share that a bounce does not bring out.
vec3 later_bounces(vec3 reflectance, float loss) {
    return reflectance * reflectance * (1.0 - loss) / (1.0 - reflectance * loss);
}

#endif
