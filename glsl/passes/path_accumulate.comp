#version 460
#extension GL_GOOGLE_include_directive : require
// Path accumulate: one invocation per pixel of the window, in squares, and per layer of light adds the sum of the
// frame's samples to those of earlier frames, and replaces it by the mean of all samples. The first layer, z = 0, is
// the picture itself.
//
// All samples of a picture are added in one binary tree, whose leaves are the samples in the order of their indices: a
// sum of 2^n samples that begins at a multiple of 2^n is the sum of its two halves. So the picture has the same bits
// however many samples a frame draws. Of the samples so far, pixel_accumulated has one sum for each bit of their
// number, the largest first, each with an element for each pixel of each layer. If their number is no power of two, the
// mean adds up these sums, from the smallest to the largest.
// Updates pixel_accumulated and pixel_radiance (the frame's sum, then the mean).
#include "layout.glsl"

layout(local_size_x = PIXEL_GROUP_SIZE, local_size_y = PIXEL_GROUP_SIZE) in;
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) buffer PixelRadianceBlock { vec4 pixel_radiance[]; };
layout(std430, set = 0, binding = BIND_PIXEL_ACCUMULATED) buffer PixelAccumulatedBlock { vec4 pixel_accumulated[]; };

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    uint n_pixels = frame.width * frame.height;
    uint pixel_ix = gl_GlobalInvocationID.z * n_pixels + pixel.y * frame.width + pixel.x;
    uint stride = gl_NumWorkGroups.z * n_pixels;
    uint n_earlier = frame.n_samples - (1u << frame.samples_log2);
    uint n_sums = uint(bitCount(n_earlier));
    precise vec4 sum = pixel_radiance[pixel_ix];
    for (uint level = frame.samples_log2; ((n_earlier >> level) & 1u) != 0u; ++level) {
        n_sums -= 1u;
        sum = pixel_accumulated[n_sums * stride + pixel_ix] + sum;
    }
    pixel_accumulated[n_sums * stride + pixel_ix] = sum;
    for (; n_sums > 0u; --n_sums) sum = pixel_accumulated[(n_sums - 1u) * stride + pixel_ix] + sum;
    pixel_radiance[pixel_ix] = sum * frame.samples_reciprocal;
}
