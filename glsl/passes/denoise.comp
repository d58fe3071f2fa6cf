#version 460
#extension GL_GOOGLE_include_directive : require
// Denoise (the paper's section 2.4): one invocation per pixel of the window, in squares, compares the pixel with its
// four neighbours. If the luminance differences add up to more than the threshold, it replaces the pixel by the mean
// of the five.
// Reads pixel_radiance; writes pixel_filtered.
#include "layout.glsl"
#include "picture/display.glsl"

layout(local_size_x = PIXEL_GROUP_SIZE, local_size_y = PIXEL_GROUP_SIZE) in;
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) readonly buffer PixelRadianceBlock { vec4 pixel_radiance[]; };
layout(std430, set = 0, binding = BIND_PIXEL_FILTERED) writeonly buffer PixelFilteredBlock { vec4 pixel_filtered[]; };

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    uvec2 size = uvec2(frame.width, frame.height);
    if (any(greaterThanEqual(pixel, size))) return;
    // At the border, the pixel itself replaces a missing neighbour.
    uvec2 low = max(pixel, uvec2(1u)) - 1u;
    uvec2 high = min(pixel + 1u, size - 1u);
    vec4 centre = pixel_radiance[pixel.y * size.x + pixel.x];
    vec4 neighbours[4] = vec4[4](
        pixel_radiance[pixel.y * size.x + low.x], pixel_radiance[pixel.y * size.x + high.x],
        pixel_radiance[low.y * size.x + pixel.x], pixel_radiance[high.y * size.x + pixel.x]);

    float difference = 0.0;
    vec4 sum = centre;
    for (int i = 0; i < 4; ++i) {
        difference += abs(luminance(neighbours[i].rgb, frame.exposure) - luminance(centre.rgb, frame.exposure));
        sum += neighbours[i];
    }
    pixel_filtered[pixel.y * size.x + pixel.x] = difference > frame.denoise_threshold ? sum / 5.0 : centre;
}
