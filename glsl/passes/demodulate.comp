#version 460
#extension GL_GOOGLE_include_directive : require
// Demodulate: one invocation per pixel of the window, in squares, divides the light that the pixel's surfaces scatter
// to the camera by their albedo, so that the noise filter `edge` does not blur textures. It estimates the variance of
// the light's luminance from the samples, and from the pixels around.
// Reads pixel_radiance and pixel_aux; writes the second half of pixel_filtered.
#include "layout.glsl"
#include "picture/noise.glsl"
#include "picture/edge.glsl"

layout(local_size_x = PIXEL_GROUP_SIZE, local_size_y = PIXEL_GROUP_SIZE) in;
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) readonly buffer PixelRadianceBlock { vec4 pixel_radiance[]; };
layout(std430, set = 0, binding = BIND_PIXEL_AUX) readonly buffer PixelAuxBlock { Auxiliary pixel_aux[]; };
layout(std430, set = 0, binding = BIND_PIXEL_FILTERED) writeonly buffer PixelFilteredBlock { vec4 pixel_filtered[]; };

// The radius of the square in which the variance is estimated, pixels.
const int RADIUS = 3;

// The variance of the light, as the pixels of the same surface around show it. pixel: of the window.
float variance_around(ivec2 pixel, Auxiliary aux) {
    ivec2 size = ivec2(frame.width, frame.height);
    ivec2 low = max(pixel - RADIUS, ivec2(0)), high = min(pixel + RADIUS, size - 1);
    vec3 sums = vec3(0.0); // of weights, of weighted luminances and of their squares
    for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) {
            int other_ix = y * size.x + x;
            Auxiliary other = pixel_aux[other_ix];
            float luminance = luminance_of(light_on(pixel_radiance[other_ix].xyz, other));
            sums += surface_weight(aux, other) * vec3(1.0, luminance, luminance * luminance);
        }
    }
    if (!(sums.x > 0.0)) return 0.0;
    float mean = sums.y / sums.x;
    return max(sums.z / sums.x - mean * mean, 0.0);
}

// The variance of the light, as the pixel's own samples show it. There are at least two of them.
float variance_of_samples(vec4 radiance, Auxiliary aux) {
    float albedo = luminance_of(aux.albedo);
    if (!(albedo > LEAST_ALBEDO)) return 0.0;
    // Light that is seen and light that is scattered are taken to come from different samples.
    vec4 scattered = vec4(max(radiance.xyz - aux.seen, 0.0), radiance.w - aux.seen_squared);
    return variance_of_mean(scattered, frame.n_samples) / (albedo * albedo);
}

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    int pixel_ix = pixel.y * int(frame.width) + pixel.x;
    Auxiliary aux = pixel_aux[pixel_ix];
    vec4 radiance = pixel_radiance[pixel_ix];
    float variance = frame.n_samples > 1u ? variance_of_samples(radiance, aux) : variance_around(pixel, aux);
    pixel_filtered[frame.width * frame.height + pixel_ix] = vec4(light_on(radiance.xyz, aux), variance);
}
