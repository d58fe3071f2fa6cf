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

float loss_polynomial(float z, vec4 powers, float fifth) {
    float y = 10.795775 + dot(vec4(-16.239405, 51.006134, -202.83482, 78.299561), powers) + 161.27727 * fifth;
    y = y * z + -26.562994 + dot(vec4(49.515839, -153.49359, 573.59247, -562.10712), powers) + 9.8753901 * fifth;
    y = y * z + 21.523111 + dot(vec4(-54.38987, 151.65544, -468.54492, 543.95184), powers) + -135.23792 * fifth;
    y = y * z + -7.1015534 + dot(vec4(27.680758, -71.783775, 157.78279, -171.56929), powers) + 50.612175 * fifth;
    y = y * z + 1.3948812 + dot(vec4(-6.7729173, 20.076412, -35.698917, 37.305031), powers) + -12.584991 * fifth;
    y = y * z + -0.065100223 + dot(vec4(0.53698862, -1.8196399, 3.0541897, -2.4706855), powers) + 0.77343577 * fifth;
    return y;
}

float grazing_polynomial(float z, vec4 powers, float fifth) {
    float y = -15.311678 + dot(vec4(77.970711, -616.11096, 1457.0963, -1220.7534), powers) + 398.43201 * fifth;
    y = y * z + 34.28347 + dot(vec4(-95.196609, 811.09833, -2338.3191, 2226.7793), powers) + -709.02826 * fifth;
    y = y * z + -27.839417 + dot(vec4(41.735516, -209.92664, 854.85785, -1024.0162), powers) + 378.24075 * fifth;
    y = y * z + 10.974108 + dot(vec4(-33.234219, 68.285072, -130.46713, 134.6618), powers) + -53.064407 * fifth;
    y = y * z + -2.5162318 + dot(vec4(13.853616, -45.667526, 88.942169, -74.077003), powers) + 23.311783 * fifth;
    y = y * z + 0.26436004 + dot(vec4(-4.1400652, 5.2931671, -2.6391835, -0.070078336), powers) + 0.33687666 * fifth;
    return y;
}

// roughness: square root of the distribution's width; 0 if the surface is perfectly smooth.
GgxAlbedo ggx_albedo(float cosine, float roughness) {
    vec4 powers = roughness_powers(roughness);
    float fifth = roughness * powers.w;
    float z = cosine / (cosine + powers.y);
    float x = clamp(1.0 - cosine, 0.0, 1.0);
    float loss = clamp((1.0 - z) * loss_polynomial(z, powers, fifth), 0.0, 0.9);
    float smooth_grazing = x * x * x * x * x;
    float grazing = smooth_grazing + (1.0 - z) * grazing_polynomial(z, powers, fifth);
    return GgxAlbedo(loss, clamp(grazing, 0.0001, 1.0 - loss));
}

// The mean of `ggx_albedo` over the hemisphere, weighted by the cosine.
GgxAlbedo mean_ggx_albedo(float roughness) {
    vec4 powers = roughness_powers(roughness);
    float fifth = roughness * powers.w;
    float loss = 0.000210142 + dot(vec4(-0.036332227, 0.48725173, 2.7229965, -4.1021533), powers) + 1.5190759 * fifth;
    float change = -0.030435629 + dot(vec4(0.54656982, -3.856077, 8.7369375, -8.3240175), powers) + 2.8850048 * fifth;
    return GgxAlbedo(max(roughness * loss, 0.0), 1.0 / 21.0 + roughness * change);
}

// Of the sheen of reflectance 1. roughness: at least LEAST_SHEEN_ROUGHNESS.
float sheen_albedo(float cosine, float roughness) {
    vec4 powers = roughness_powers(roughness);
    float z = clamp(1.0 - cosine, 0.0, 1.0);
    float y = 24.152172 + dot(vec4(-120.4353, 203.7431, -154.49158, 44.784389), powers);
    y = y * z + -64.693489 + dot(vec4(332.72348, -565.05505, 430.55728, -125.53234), powers);
    y = y * z + 68.502266 + dot(vec4(-364.3663, 625.81909, -481.81183, 141.72218), powers);
    y = y * z + -35.167366 + dot(vec4(195.56726, -341.27466, 265.25433, -78.338684), powers);
    y = y * z + 11.311654 + dot(vec4(-64.828766, 117.18, -92.910378, 27.634874), powers);
    y = y * z + -2.5980201 + dot(vec4(18.863771, -38.492477, 33.642723, -10.890631), powers);
    y = y * z + 0.087039657 + dot(vec4(-1.1872613, 4.6144295, -4.6789732, 1.5662416), powers);
    y = max(y, 0.01);
    return y * y;
}

#endif
