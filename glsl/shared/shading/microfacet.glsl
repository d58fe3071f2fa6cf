// Reflection by microfacets: metals and dielectrics, after glTF 2.0, Appendix B. Twin of src/reference/microfacet.rs.
//
// - The microfacets' normals have the distribution GGX (Walter et al.: Microfacet Models for Refraction through Rough
//   Surfaces, EGSR 2007), whose width is the squared roughness.
// - Masking and shadowing are Smith's for that distribution, correlated in height (Heitz: Understanding the
//   Masking-Shadowing Function, JCGT 2014).
// - Reflectance grows towards grazing angles by Schlick's approximation (An Inexpensive BRDF Model, 1994). At the
//   boundary of a solid, reflected and refracted rays get the exact Fresnel term.
// - Below a dielectric's microfacets is a Lambertian surface, or light passes through.
//
// All reflectances are multiplied by pi, as those of Phong's model: a white Lambertian surface of reflectance 1 shows
// the irradiance as radiance.
#ifndef KDRAY_MICROFACET
#define KDRAY_MICROFACET

#include "layout.glsl"

layout(constant_id = CONSTANT_MICROFACETS) const bool MICROFACETS = false;

// Whether the material reflects by microfacets.
bool is_microfacet(Material material) {
    return MICROFACETS && (material.flags & MATERIAL_MICROFACET) != 0u;
}

// The width of the distribution of normals.
float microfacet_width(Material material) {
    return max(material.roughness * material.roughness, LEAST_MICROFACET_WIDTH);
}

// The dielectric's reflectance for light along the normal.
vec3 normal_reflectance(Material material) {
    float ratio = (material.ni - 1.0) / (material.ni + 1.0);
    return min(ratio * ratio * material.ks, vec3(1.0));
}

// Schlick's weight of the reflectance at grazing angles.
float grazing_weight(float cosine) {
    float x = clamp(1.0 - cosine, 0.0, 1.0);
    return x * x * x * x * x;
}

float largest_of(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

// The dielectric's reflectance where the light's angle to the normal has this cosine.
vec3 dielectric_reflectance(Material material, float cosine) {
    float at_grazing = min(largest_of(material.ks), 1.0);
    return mix(normal_reflectance(material), vec3(at_grazing), grazing_weight(cosine));
}

// The metal's reflectance where the light's angle to the normal has this cosine.
vec3 metal_reflectance(Material material, float cosine) {
    return mix(material.kd, vec3(1.0), grazing_weight(cosine));
}

// pi times the distribution of normals, times masking and shadowing, divided by 4 and by both cosines.
// sin_half_squared, cos_half: of the angle between the normal and the half vector.
float ggx_smith(float width, float cos_view, float cos_light, float cos_half, float sin_half_squared) {
    float squared = width * width;
    float spread = sin_half_squared + cos_half * cos_half * squared;
    float distribution = squared / (spread * spread);
    float shadowing = cos_light * sqrt(cos_view * cos_view * (1.0 - squared) + squared)
        + cos_view * sqrt(cos_light * cos_light * (1.0 - squared) + squared);
    return distribution * 0.5 / shadowing;
}

// The reflectance towards the viewer, times the cosine of the light's direction. All vectors are unit vectors that
// point away from the surface.
vec3 microfacet_reflectance(Material material, vec3 normal, vec3 to_viewer, vec3 to_light) {
    float cos_light = dot(normal, to_light);
    if (!(cos_light > 0.0)) return vec3(0.0);
    float cos_view = max(dot(normal, to_viewer), LEAST_COSINE);
    vec3 between = normalize(to_viewer + to_light);
    vec3 aside = cross(normal, between);
    float lobe = ggx_smith(
        microfacet_width(material), cos_view, cos_light, dot(normal, between), dot(aside, aside)
    );
    float cos_between = dot(to_viewer, between);
    vec3 fresnel = dielectric_reflectance(material, cos_between);
    vec3 diffuse = material.kd * ((1.0 - material.transmission) * (1.0 - largest_of(fresnel)));
    vec3 metal = metal_reflectance(material, cos_between) * lobe;
    return mix(diffuse + fresnel * lobe, metal, material.metallic) * cos_light;
}

// The share of the reflected light that arrives as a mirrored ray. The surface shows the rest by lights alone.
float mirror_share(Material material) {
    return clamp((DIFFUSE_ROUGHNESS - material.roughness) / (DIFFUSE_ROUGHNESS - MIRROR_ROUGHNESS), 0.0, 1.0);
}

// The share of uniform light from all directions that the surface reflects: diffusely, and by its microfacets except
// for what arrives as a mirrored ray. The microfacets' share is an approximation (Karis: Physically Based Shading on
// Mobile, 2014).
vec3 ambient_reflectance(Material material, vec3 normal, vec3 to_viewer) {
    float cos_view = max(dot(normal, to_viewer), LEAST_COSINE);
    vec4 r = material.roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a = min(r.x * r.x, exp2(-9.28 * cos_view)) * r.x + r.y;
    vec2 scale_and_bias = vec2(-1.04, 1.04) * a + r.zw;
    float at_grazing = min(largest_of(material.ks), 1.0);
    vec3 dielectric = normal_reflectance(material) * scale_and_bias.x + at_grazing * scale_and_bias.y;
    vec3 metal = material.kd * scale_and_bias.x + scale_and_bias.y;
    vec3 diffuse = material.kd * ((1.0 - material.transmission) * (1.0 - largest_of(dielectric)));
    float by_lights = 1.0 - mirror_share(material);
    return mix(diffuse + dielectric * by_lights, metal * by_lights, material.metallic);
}

#endif
