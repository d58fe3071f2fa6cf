// Reflection by microfacets (Cook, Torrance: A Reflectance Model for Computer Graphics, 1982), with the normals of
// ggx.glsl. Directions are in the frame of the surface. Twin of src/reference/bsdf/reflection.rs.
#ifndef KDRAY_BSDF_REFLECTION
#define KDRAY_BSDF_REFLECTION

#include "bsdf/ggx.glsl"

// The direction that a microfacet of this normal reflects to the viewer.
vec3 reflected_by(vec3 to_viewer, vec3 half_vector) {
    return 2.0 * dot(to_viewer, half_vector) * half_vector - to_viewer;
}

// The reflectance times the light's cosine, for a Fresnel term of 1.
float evaluate_reflection(vec3 to_viewer, vec3 to_light, vec3 half_vector, float width) {
    float visibility = ggx_visibility(to_viewer.z, to_light.z, width);
    return 0.25 * ggx_distribution(half_vector, width) * visibility;
}

// Pdf of the light's direction, per steradian, if a visible normal reflects it.
float reflection_pdf(vec3 to_viewer, vec3 half_vector, float width) {
    return 0.25 * ggx_visible_pdf(to_viewer, half_vector, width);
}

#endif
