// Tone curves: from exposed radiance, which has no upper bound, to display values, 0..1. Both radiance and display
// values are linear, with Rec. 709 primaries.
#ifndef KDRAY_TONE_CURVES
#define KDRAY_TONE_CURVES

#include "layout.glsl"

// Exposed radiance is clamped to this, since infinities would become NaN. Every curve shows white above it.
const float BRIGHTEST = 65504.0;

// ACES: S. Hill's fit of the reference rendering and output transforms for sRGB (T. Pettineo, BakingLab, 2016).
// All matrices in this file are given by rows, so `v * rows` is the product of the matrix and the column vector.
vec3 aces(vec3 exposed) {
    const mat3 to_ap1 = mat3(0.59719, 0.35458, 0.04823, 0.07600, 0.90834, 0.01566, 0.02840, 0.13383, 0.83777);
    const mat3 from_ap1 = mat3(1.60475, -0.53108, -0.07367, -0.10208, 1.10813, -0.00605, -0.00327, -0.07276, 1.07602);
    vec3 v = exposed * to_ap1;
    vec3 numerator = v * (v + 0.0245786) - 0.000090537;
    vec3 denominator = v * (0.983729 * v + 0.4329510) + 0.238081;
    return (numerator / denominator) * from_ap1;
}

// AgX (T. Sobotka, 2022) in B. Wrensch's fit (Minimal AgX Implementation, 2023): the inset matrix, a logarithm over
// 16.5 stops, a polynomial for the contrast curve, the outset matrix, and a power of 2.2, which undoes the display's
// encoding.
vec3 agx(vec3 exposed) {
    const mat3 inset = mat3(0.842479062253094, 0.0784335999999992, 0.0792237451477643,
                            0.0423282422610123, 0.878468636469772, 0.0791661274605434,
                            0.0423756549057051, 0.0784336, 0.879142973793104);
    const mat3 outset = mat3(1.19687900512017, -0.0980208811401368, -0.0990297440797205,
                             -0.0528968517574562, 1.15190312990417, -0.0989611768448433,
                             -0.0529716355144438, -0.0980434501171241, 1.15107367264116);
    const float least_ev = -12.47393;
    const float most_ev = 4.026069;
    vec3 ev = clamp(log2(max(exposed * inset, vec3(1e-10))), least_ev, most_ev);
    vec3 x = (ev - least_ev) / (most_ev - least_ev);
    vec3 curve = (((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x - 0.00232;
    return pow(max(curve * outset, vec3(0.0)), vec3(2.2));
}

// Khronos PBR Neutral (2024): base colours below 0.8 are shown as they are, less the 0.04 that a dielectric reflects.
// Brighter ones are compressed by a hyperbola that joins without a kink, and fade towards white.
vec3 neutral(vec3 exposed) {
    const float first_compressed = 0.8 - 0.04;
    const float room_above = 1.0 - first_compressed;
    const float fading = 0.15;
    float least = min(exposed.r, min(exposed.g, exposed.b));
    exposed -= least < 0.08 ? least - 6.25 * least * least : 0.04;
    float peak = max(exposed.r, max(exposed.g, exposed.b));
    if (peak < first_compressed) return exposed;
    float shown_peak = 1.0 - room_above * room_above / (peak + room_above - first_compressed);
    float kept = 1.0 / (fading * (peak - shown_peak) + 1.0);
    return mix(vec3(shown_peak), exposed * (shown_peak / peak), kept);
}

// Applies the exposure and a curve, one of TONEMAP_*. Returns linear display values, 0..1.
vec3 tone_mapped(uint curve, vec3 radiance, float exposure) {
    vec3 exposed = clamp(radiance * exposure, vec3(0.0), vec3(BRIGHTEST));
    if (curve == TONEMAP_AGX) exposed = agx(exposed);
    if (curve == TONEMAP_ACES) exposed = aces(exposed);
    if (curve == TONEMAP_NEUTRAL) exposed = neutral(exposed);
    return clamp(exposed, vec3(0.0), vec3(1.0));
}

#endif
