// The sheen of cloth, whose fibres stand upright (Estevez, Kulla: Production Friendly Microfacet Sheen BRDF, SIGGRAPH
// 2017 courses; KHR_materials_sheen). Directions are in the frame of the surface. Twin of src/reference/bsdf/sheen.rs.
//
// The model can reflect more light than it receives at grazing angles. It is then divided by its albedo.
#ifndef KDRAY_BSDF_SHEEN
#define KDRAY_BSDF_SHEEN

#include "constants.glsl"
#include "bsdf/albedo.glsl"

// Pdf of the fibres' normals. width: of the distribution.
float sheen_distribution(vec3 half_vector, float width) {
    float sine = sqrt(clamp(dot(half_vector.xy, half_vector.xy), 0.0, 1.0));
    return (2.0 + 1.0 / width) * pow(max(sine, 1.0e-6), 1.0 / width) / (2.0 * PI);
}

// The fit of Estevez and Kulla: its constants are for the widths 0 and 1.
float sheen_exponent(float cosine, float width) {
    float weight = (1.0 - width) * (1.0 - width);
    float a = mix(21.5473, 25.3245, weight), b = mix(3.82987, 3.32435, weight);
    float c = mix(0.19823, 0.16801, weight), d = mix(-1.97760, -1.27393, weight), e = mix(-4.32054, -4.85967, weight);
    return a / (1.0 + b * pow(max(cosine, 1.0e-6), c)) + d * cosine + e;
}

// Smith's Lambda of the distribution.
float sheen_lambda(float cosine, float width) {
    if (cosine < 0.5) return exp(sheen_exponent(cosine, width));
    return exp(2.0 * sheen_exponent(0.5, width) - sheen_exponent(1.0 - cosine, width));
}

// The factor that keeps the albedo at or below 1. albedo: of the model.
float sheen_bound(float albedo) {
    return 1.0 / max(albedo, 1.0);
}

// The reflectance times the light's cosine, for a sheen of reflectance 1, without the bound.
float evaluate_sheen(vec3 to_viewer, vec3 to_light, float roughness) {
    float width = roughness * roughness;
    vec3 half_vector = normalize(to_viewer + to_light);
    float shadowing = 1.0 + sheen_lambda(to_viewer.z, width) + sheen_lambda(to_light.z, width);
    return sheen_distribution(half_vector, width) / (shadowing * 4.0 * to_viewer.z);
}

// A direction of the hemisphere, all alike, as the paper advises.
vec3 sample_sheen(vec2 u) {
    float sine = sqrt(max(1.0 - u.x * u.x, 0.0)), azimuth = 2.0 * PI * u.y;
    return vec3(sine * cos(azimuth), sine * sin(azimuth), u.x);
}

float sheen_pdf(vec3 to_light) {
    return to_light.z > 0.0 ? 0.5 / PI : 0.0;
}

#endif
