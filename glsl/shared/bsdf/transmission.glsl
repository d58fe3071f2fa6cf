// Refraction by the microfacets of a solid's boundary (Walter et al.: Microfacet Models for Refraction through Rough
// Surfaces, EGSR 2007), with the normals of ggx.glsl. Directions are in the frame of the surface, and the viewer's is
// on the side of the normal. Twin of src/reference/bsdf/transmission.rs.
//
// Radiance changes with the square of the index where light crosses the boundary. A path towards a light is followed
// against the light, so its throughput is multiplied by eta^2. eta: index of refraction on the viewer's side divided
// by that of the other side.
#ifndef KDRAY_BSDF_TRANSMISSION
#define KDRAY_BSDF_TRANSMISSION

#include "shading/fresnel.glsl"
#include "bsdf/ggx.glsl"

// The direction that a microfacet of this normal refracts to the viewer. There must be no total reflection.
vec3 refracted_by(vec3 to_viewer, vec3 half_vector, float eta) {
    float cosine = dot(to_viewer, half_vector);
    float bend = eta * cosine - refraction_cosine(cosine, eta);
    return normalize(bend * half_vector - eta * to_viewer);
}

// The normal, on the viewer's side, of the microfacets that refract the one direction into the other.
vec3 refracting_normal(vec3 to_viewer, vec3 to_light, float eta) {
    vec3 normal = normalize(eta * to_viewer + to_light);
    return normal.z < 0.0 ? -normal : normal;
}

// Whether each direction is on the same side of the microfacet as of the surface.
bool refracts_between(vec3 to_viewer, vec3 to_light, vec3 half_vector) {
    return dot(to_viewer, half_vector) > 0.0 && dot(to_light, half_vector) < 0.0;
}

// Jacobian of refraction: the factor by which the pdf of a normal becomes the pdf of the light's direction.
float refraction_jacobian(vec3 to_viewer, vec3 to_light, vec3 half_vector, float eta) {
    float cos_light = dot(to_light, half_vector);
    float sum = cos_light + eta * dot(to_viewer, half_vector);
    return abs(cos_light) / (sum * sum);
}

// The transmittance times the light's cosine, if the microfacets let all light pass.
float evaluate_refraction(vec3 to_viewer, vec3 to_light, vec3 half_vector, float width, float eta) {
    float visibility = ggx_visibility(to_viewer.z, abs(to_light.z), width) * ggx_distribution(half_vector, width);
    float cos_viewer = dot(to_viewer, half_vector);
    return eta * eta * visibility * cos_viewer * refraction_jacobian(to_viewer, to_light, half_vector, eta);
}

// Pdf of the light's direction, per steradian, if a visible normal refracts it.
float refraction_pdf(vec3 to_viewer, vec3 to_light, vec3 half_vector, float width, float eta) {
    float of_normal = ggx_visible_pdf(to_viewer, half_vector, width) * dot(to_viewer, half_vector);
    return of_normal * refraction_jacobian(to_viewer, to_light, half_vector, eta);
}

#endif
