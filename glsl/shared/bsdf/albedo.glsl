// Directional albedos: the share of the light from one direction that a lobe reflects. Twin of
// src/reference/bsdf/albedo.rs.
//
// They have no closed form. The polynomials are fits by least squares, which tests/long/albedo_fit.py makes. The unit
// tests of the twin integrate the lobes and state the errors.
#ifndef KDRAY_BSDF_ALBEDO
#define KDRAY_BSDF_ALBEDO

// Of reflection by GGX, at one cosine. loss: the share of light that is not reflected although the Fresnel term is 1,
// because it meets further microfacets. grazing: the share that is reflected if the Fresnel term is Schlick's weight
// (1 - V.H)^5. So a Fresnel term F0 + (F90 - F0) (1 - V.H)^5 reflects F0 (1 - loss - grazing) + F90 grazing.
struct GgxAlbedo {
    float loss;
    float grazing;
};

// Powers 1 to 4 of the roughness.
vec4 roughness_powers(float roughness) {
    float squared = roughness * roughness;
    return vec4(roughness, squared, squared * roughness, squared * squared);
}

float loss_polynomial(float z, vec4 powers) {
    float y = 1.8103135 + dot(vec4(17.644272, -48.685867, 54.702972, -79.665092), powers);
    y = y * z + -3.1318867 + dot(vec4(-32.687866, 106.18821, -128.7383, 117.78883), powers);
    y = y * z + 1.0895424 + dot(vec4(14.451166, -50.563808, 62.125889, -48.548805), powers);
    y = y * z + 0.27177879 + dot(vec4(0.053681884, -1.788789, 7.0341892, 0.087344877), powers);
    y = y * z + 0.0019733009 + dot(vec4(0.020006094, -0.085017398, 0.11722442, -0.032452136), powers);
    return y;
}

float grazing_polynomial(float z, vec4 powers) {
    float y = 0.17026286 + dot(vec4(-40.135624, 71.991638, 29.312443, -7.0983129), powers);
    y = y * z + -0.99493665 + dot(vec4(91.650658, -287.85217, 151.4442, 35.913036), powers);
    y = y * z + 1.1559658 + dot(vec4(-52.552502, 241.3324, -300.06158, 90.341942), powers);
    y = y * z + -0.54141819 + dot(vec4(4.3573852, -17.462431, 40.811142, -18.658777), powers);
    y = y * z + 0.17344359 + dot(vec4(-3.660898, 4.5660009, -2.5668268, 0.53247041), powers);
    return y;
}

// roughness: square root of the distribution's width; 0 if the surface is perfectly smooth.
GgxAlbedo ggx_albedo(float cosine, float roughness) {
    vec4 powers = roughness_powers(roughness);
    float z = cosine / (cosine + 2.0 * powers.y);
    float x = clamp(1.0 - cosine, 0.0, 1.0);
    float loss = clamp((1.0 - z) * loss_polynomial(z, powers), 0.0, 0.9);
    float smooth_grazing = x * x * x * x * x;
    float grazing = smooth_grazing + (1.0 - z) * grazing_polynomial(z, powers);
    return GgxAlbedo(loss, clamp(grazing, 0.0001, 1.0 - loss));
}

// The mean of `ggx_albedo` over the hemisphere, weighted by the cosine.
GgxAlbedo mean_ggx_albedo(float roughness) {
    vec4 powers = roughness_powers(roughness);
    float loss = roughness * (0.012756904 + dot(vec4(-0.24498497, 1.8110416, -0.72292089, -0.26957878), powers));
    float change = -0.0036951823 + dot(vec4(-0.0077142245, -0.72144741, 1.3787318, -0.69522977), powers);
    float grazing = 1.0 / 21.0 + roughness * change;
    return GgxAlbedo(max(loss, 0.0), grazing);
}

// Of the sheen of reflectance 1. roughness: at least LEAST_SHEEN_ROUGHNESS.
float sheen_albedo(float cosine, float roughness) {
    vec4 powers = roughness_powers(roughness);
    float z = clamp(1.0 - cosine, 0.0, 1.0);
    float y = 23.986086 + dot(vec4(-119.28143, 200.94769, -151.67065, 43.763714), powers);
    y = y * z + -64.226761 + dot(vec4(329.45627, -557.09039, 422.47842, -122.59611), powers);
    y = y * z + 68.012299 + dot(vec4(-360.90784, 617.33014, -473.15115, 138.55827), powers);
    y = y * z + -34.929424 + dot(vec4(193.87425, -337.08887, 260.95612, -76.759003), powers);
    y = y * z + 11.257267 + dot(vec4(-64.440125, 116.21407, -91.912369, 27.265678), powers);
    y = y * z + -2.5927036 + dot(vec4(18.825815, -38.398308, 33.545334, -10.854482), powers);
    y = y * z + 0.08693248 + dot(vec4(-1.1865282, 4.6127133, -4.6773009, 1.5656458), powers);
    y = max(y, 0.01);
    return y * y;
}

#endif
