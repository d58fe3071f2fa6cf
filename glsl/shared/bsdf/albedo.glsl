// Directional albedos: the share of the light from one direction that a lobe reflects. Twin of
// src/reference/bsdf/albedo.rs.
//
// They have no closed form. The polynomials are fits by least squares, which tests/long/albedo_fit.py makes. The unit
// tests of the twin integrate the lobes and state the errors.
#ifndef KDRAY_BSDF_ALBEDO
#define KDRAY_BSDF_ALBEDO

// The albedo of reflection by GGX at one cosine. A Fresnel term F0 + (F90 - F0) (1 - V.H)^5 reflects
// F0 (1 - loss - grazing) + F90 grazing. loss: the share of light that is not reflected although the Fresnel term is
// 1, because it meets further microfacets. grazing: the share that is reflected if the Fresnel term is Schlick's weight
// (1 - V.H)^5.
struct GgxAlbedo {
    float loss;
    float grazing;
};

// Powers 1 to 4.
vec4 powers_of(float x) {
    float squared = x * x;
    return vec4(x, squared, squared * x, squared * squared);
}

// The variable of the polynomials, -1 to 1, for one of 0 to 1. Coefficients are then small, and round little.
float centred(float x) {
    return 2.0 * x - 1.0;
}

float loss_polynomial(float z, vec4 powers, float fifth) {
    float y = 0.05061298 + dot(vec4(-0.48358548, 0.15916474, 1.2829756, 1.0614296), powers) + 0.20548154 * fifth;
    y = y * z + -0.13874173 + dot(vec4(-0.6994655, 0.15456805, 2.2882538, 2.5646296), powers) + 0.94598657 * fifth;
    y = y * z + -0.39460304 + dot(vec4(0.22238626, 0.37179673, 1.3073437, 2.1353924), powers) + 1.1228601 * fifth;
    y = y * z + -0.12285215 + dot(vec4(0.7024384, 0.82025933, 0.5706922, 0.5520335), powers) + 0.27289453 * fifth;
    y = y * z + 0.40329757 + dot(vec4(0.6511315, 1.0314175, 0.60844195, -0.1749438), powers) + -0.27012518 * fifth;
    y = y * z + 0.32030332 + dot(vec4(0.39432263, 0.5965222, 0.33280572, -0.11012778), powers) + -0.14635271 * fifth;
    return y;
}

float grazing_polynomial(float z, vec4 powers, float fifth) {
    float y = -0.27699554 + dot(vec4(0.86916727, 0.8740421, 1.7877537, 1.8112689), powers) + -1.5997394 * fifth;
    y = y * z + -0.8551063 + dot(vec4(0.6374431, 4.513031, 4.2166076, 1.7199866), powers) + -0.090891734 * fifth;
    y = y * z + -0.8048706 + dot(vec4(-2.256373, 3.9497612, 5.400407, 1.3915476), powers) + 2.6716585 * fifth;
    y = y * z + 0.19544311 + dot(vec4(-2.9967628, -2.5920486, 3.630944, 3.7848535), powers) + 1.0182526 * fifth;
    y = y * z + 0.9133323 + dot(vec4(0.23875533, -3.3636262, -0.2198798, 2.705742), powers) + 0.053990252 * fifth;
    y = y * z + -0.32218575 + dot(vec4(0.8386179, 0.049529385, -1.1930618, 0.22775501), powers) + 0.40759394 * fifth;
    return y;
}

// roughness: square root of the distribution's width; 0 if the surface is perfectly smooth.
GgxAlbedo ggx_albedo(float cosine, float roughness) {
    vec4 powers = powers_of(centred(roughness));
    float fifth = centred(roughness) * powers.w;
    float z = cosine / (cosine + roughness * roughness);
    float x = clamp(1.0 - cosine, 0.0, 1.0);
    float loss = clamp((1.0 - z) * loss_polynomial(centred(z), powers, fifth), 0.0, 0.9);
    float smooth_grazing = x * x * x * x * x;
    float grazing = smooth_grazing + (1.0 - z) * grazing_polynomial(centred(z), powers, fifth);
    return GgxAlbedo(loss, clamp(grazing, 0.0001, 1.0 - loss));
}

// The mean of `ggx_albedo` over the hemisphere, weighted by the cosine.
GgxAlbedo mean_ggx_albedo(float roughness) {
    vec4 powers = powers_of(centred(roughness));
    float fifth = centred(roughness) * powers.w;
    float loss = 0.23559959
        + dot(vec4(0.45514977, 0.08237253, -0.20343474, -0.023440205), powers) + 0.044103485 * fifth;
    float change = -0.059065323
        + dot(vec4(-0.0047479947, 0.08910083, -0.08968468, -0.046510242), powers) + 0.065464064 * fifth;
    return GgxAlbedo(max(roughness * loss, 0.0), 1.0 / 21.0 + roughness * change);
}

// The albedo of a sheen of reflectance 1. roughness: at least LEAST_SHEEN_ROUGHNESS.
float sheen_albedo(float cosine, float roughness) {
    vec4 powers = powers_of(centred(roughness));
    float z = centred(clamp(1.0 - cosine, 0.0, 1.0));
    float y = -0.025658233 + dot(vec4(-0.079442926, 0.15305589, -0.12680236, 0.04373475), powers);
    y = y * z + 0.04537495 + dot(vec4(-0.04196653, 0.07835384, -0.05967113, 0.017228179), powers);
    y = y * z + 0.074563555 + dot(vec4(0.07415557, -0.096496835, 0.05393373, -0.016278138), powers);
    y = y * z + 0.026118582 + dot(vec4(0.006430548, -0.011569813, -0.027085755, 0.02527979), powers);
    y = y * z + 0.046010688 + dot(vec4(-0.09292707, 0.23614322, -0.2758054, 0.12156358), powers);
    y = y * z + 0.298807 + dot(vec4(-0.13584308, 0.102032214, 0.02426417, -0.061889347), powers);
    y = y * z + 0.4354193 + dot(vec4(0.27736488, -0.137553, 0.09287007, -0.070511475), powers);
    y = max(y, 0.01);
    return y * y;
}

#endif
