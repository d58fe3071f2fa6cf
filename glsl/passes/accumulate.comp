#version 460
#extension GL_GOOGLE_include_directive : require
// Accumulate: one invocation per pixel of the window, in squares, and per layer of surfaces adds the frame's sample to
// the sum of the earlier samples and replaces the sample by the mean of all samples. The first layer, z = 0, is the
// picture itself. If the ray queue overflowed, the frame is drawn again and this dispatch adds nothing.
// Reads bounces; updates pixel_accumulated (sums of radiance) and pixel_radiance (the sample, then the mean).
#include "layout.glsl"

layout(local_size_x = PIXEL_GROUP_SIZE, local_size_y = PIXEL_GROUP_SIZE) in;
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) buffer PixelRadianceBlock { vec4 pixel_radiance[]; };
layout(std430, set = 0, binding = BIND_PIXEL_ACCUMULATED) buffer PixelAccumulatedBlock { vec4 pixel_accumulated[]; };

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    if (bounces[0].any_overflow != 0u) return;
    uint pixel_ix = (gl_GlobalInvocationID.z * frame.height + pixel.y) * frame.width + pixel.x;
    vec4 sum = pixel_accumulated[pixel_ix] + pixel_radiance[pixel_ix];
    pixel_accumulated[pixel_ix] = sum;
    pixel_radiance[pixel_ix] = sum / float(frame.n_samples);
}
