#version 460
#extension GL_GOOGLE_include_directive : require
// Edge filter: one invocation per pixel of the window, in squares, takes one iteration of the noise filter `edge`, an
// edge-avoiding a-trous wavelet transform (Dammertz et al.: Edge-Avoiding A-Trous Wavelet Transform for Fast Global
// Illumination Filtering, 2010) that is guided by variance (Schied et al.: Spatiotemporal Variance-Guided Filtering,
// 2017). It replaces the light of the pixel by a mean of 5 x 5 pixels, which are 2^iteration_ix pixels apart. A pixel
// counts the more, the more alike its surface is, and the less its light differs beyond the noise. The last iteration
// multiplies the light by the albedo again and adds what the camera sees directly.
// Reads pixel_aux; updates pixel_filtered: even iterations read its second half and write the first one.
#include "layout.glsl"
#include "picture/noise.glsl"
#include "picture/edge.glsl"

layout(local_size_x = PIXEL_GROUP_SIZE, local_size_y = PIXEL_GROUP_SIZE) in;
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_PIXEL_AUX) readonly buffer PixelAuxBlock { Auxiliary pixel_aux[]; };
layout(std430, set = 0, binding = BIND_PIXEL_FILTERED) buffer PixelFilteredBlock { vec4 pixel_filtered[]; };
layout(push_constant) uniform AtrousIterationBlock { AtrousIteration atrous_iteration; };

// How many standard deviations of noise the luminances of two pixels of one sample may differ until the weight has
// fallen to 1 / e.
const float DEVIATIONS = 8.0;
// The power of the number of samples by which these deviations are multiplied. More samples show more of what is
// behind the noise, and their variance is better known.
const float DEVIATIONS_POWER = -0.4;
// The factor on these deviations for perfectly glossy surfaces. What they reflect differs from pixel to pixel.
const float GLOSSY_DEVIATIONS = 0.25;
// The variance of another pixel counts up to this multiple of the pixel's own. The multiple is 1 for perfectly glossy
// surfaces.
const float MOST_OF_OTHER = 4.0;
// A variance that is less than any noise of interest. It keeps quotients finite where there is no noise at all, and
// drivers' square roots away from numbers that are not normalized.
const float LEAST_VARIANCE = 1.0e-16;
// The weights of the five pixels in a row: a B-spline.
const float SPLINE[3] = float[3](0.375, 0.25, 0.0625);

// Where the half of pixel_filtered begins that the iteration reads.
uint source_begin() {
    return (atrous_iteration.iteration_ix & 1u) == 0u ? frame.width * frame.height : 0u;
}

bool is_in_window(ivec2 pixel) {
    return all(greaterThanEqual(pixel, ivec2(0))) && all(lessThan(pixel, ivec2(frame.width, frame.height)));
}

int index_of(ivec2 pixel) {
    return pixel.y * int(frame.width) + pixel.x;
}

// The variance of the light at a pixel, as the mean of 3 x 3 pixels that show a surface.
float variance_at(ivec2 pixel) {
    float weights = 0.0, variance = 0.0;
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 other = pixel + ivec2(x, y);
            if (!is_in_window(other) || pixel_aux[index_of(other)].n_hits == 0u) continue;
            float weight = float((2 - abs(x)) * (2 - abs(y)));
            weights += weight;
            variance += weight * pixel_filtered[source_begin() + index_of(other)].w;
        }
    }
    return weights > 0.0 ? variance / weights : 0.0;
}

// The mean of the light, and the variance of its luminance. light: of the pixel itself.
vec4 mean_around(ivec2 pixel, Auxiliary aux, vec4 light) {
    float deviations = DEVIATIONS * pow(float(frame.n_samples), DEVIATIONS_POWER);
    deviations *= mix(1.0, GLOSSY_DEVIATIONS, aux.gloss);
    float variance = variance_at(pixel), most = mix(MOST_OF_OTHER, 1.0, aux.gloss) * variance;
    float luminance = luminance_of(light.xyz), weights = 0.0;
    vec4 sum = vec4(0.0);
    for (int y = -2; y <= 2; ++y) {
        for (int x = -2; x <= 2; ++x) {
            ivec2 other = pixel + (ivec2(x, y) << atrous_iteration.iteration_ix);
            if (!is_in_window(other)) continue;
            vec4 found = pixel_filtered[source_begin() + index_of(other)];
            float weight = SPLINE[abs(x)] * SPLINE[abs(y)] * surface_weight(aux, pixel_aux[index_of(other)]);
            float tolerance = deviations * sqrt(variance + min(most, found.w) + LEAST_VARIANCE);
            weight *= exp(-abs(luminance_of(found.xyz) - luminance) / tolerance);
            weights += weight;
            sum += vec4(weight * found.xyz, weight * weight * found.w);
        }
    }
    // The square of a small weight can be 0.
    return weights > 0.0 ? vec4(sum.xyz, sum.w / weights) / weights : light;
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (!is_in_window(pixel)) return;
    int pixel_ix = index_of(pixel);
    Auxiliary aux = pixel_aux[pixel_ix];
    vec4 light = mean_around(pixel, aux, pixel_filtered[source_begin() + pixel_ix]);
    if (atrous_iteration.iteration_ix + 1u == N_ATROUS_ITERATIONS) light = vec4(light.xyz * aux.albedo + aux.seen, 1.0);
    pixel_filtered[frame.width * frame.height - source_begin() + pixel_ix] = light;
}
