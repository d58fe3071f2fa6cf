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
    float y = 8.5227442 + dot(vec4(-10.963147, 79.872063, -232.42944, 17.419209), powers) + 210.4131 * fifth;
    y = y * z + -20.575962 + dot(vec4(37.890228, -249.74614, 771.74255, -597.86566), powers) + -41.687645 * fifth;
    y = y * z + 15.525029 + dot(vec4(-40.795704, 236.88469, -706.77136, 706.883), powers) + -155.20528 * fifth;
    y = y * z + -4.2633696 + dot(vec4(17.504826, -85.484901, 228.00821, -237.29614), powers) + 67.25351 * fifth;
    y = y * z + 0.78486699 + dot(vec4(-3.3760931, 14.595876, -33.455288, 38.245049), powers) + -13.047832 * fifth;
    y = y * z + -0.021635758 + dot(vec4(0.20264785, -0.82070565, 1.5798448, -1.3904365), powers) + 0.45798045 * fifth;
    return y;
}

float grazing_polynomial(float z, vec4 powers, float fifth) {
    float y = 43.237442 + dot(vec4(-688.62921, 2864.2729, -5492.8657, 5023.2246), powers) + -1638.3431 * fifth;
    y = y * z + -98.257233 + dot(vec4(1623.2207, -6962.7178, 13274.707, -12001.156), powers) + 4049.2202 * fifth;
    y = y * z + 78.186623 + dot(vec4(-1303.4658, 5784.9307, -11117.942, 9912.4473), powers) + -3318.6135 * fifth;
    y = y * z + -24.997671 + dot(vec4(405.41129, -1829.0001, 3588.5264, -3229.603), powers) + 1082.3663 * fifth;
    y = y * z + 2.3397923 + dot(vec4(-41.212421, 180.50139, -338.95181, 304.03543), powers) + -102.57932 * fifth;
    y = y * z + -0.00194966 + dot(vec4(-1.1703906, -6.7782693, 19.844473, -19.539381), powers) + 6.6895761 * fifth;
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
    float loss = -0.0012865789 + dot(vec4(-0.01124437, 0.44400364, 2.6509104, -3.9033575), powers) + 1.4113265 * fifth;
    float change = 0.01249467 + dot(vec4(0.12266012, -2.301764, 6.0072041, -5.9807024), powers) + 2.0946815 * fifth;
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
