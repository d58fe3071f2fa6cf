// Measures of noise. Twin of src/frame/noise.rs. Needs nothing; provides the functions below.
#ifndef KDRAY_NOISE
#define KDRAY_NOISE

#include "constants.glsl"

// The luminance up to which a sample counts in variances. The sum of squares of all samples is then finite.
#define MOST_SQUARED_LUMINANCE 1.0e15

// The relative luminance of radiance (ITU-R BT.709).
float luminance_of(vec3 radiance) {
    precise float sum = 0.2126 * radiance.x + 0.7152 * radiance.y + 0.0722 * radiance.z;
    return sum;
}

// The square of a sample's luminance.
float squared_luminance(vec3 radiance) {
    precise float luminance = min(luminance_of(radiance), MOST_SQUARED_LUMINANCE);
    precise float squared = luminance * luminance;
    return squared;
}

// The variance of a pixel's mean luminance. mean: of the radiance of its samples, and in w of their squared luminance.
// It is infinite for a single sample, whose noise is unknown.
float variance_of_mean(vec4 mean, uint n_samples) {
    if (n_samples < 2u) return INFINITY;
    float luminance = luminance_of(mean.xyz);
    return max(mean.w - luminance * luminance, 0.0) / float(n_samples - 1u);
}

#endif
