#version 460
#extension GL_GOOGLE_include_directive : require
// Tonemap: one invocation per pixel of the window, in squares, applies the exposure and a tone curve and encodes the
// result as sRGB with 8 bits per channel.
// Reads pixel_filtered; writes pixel_display (R in the lowest byte).
#include "layout.glsl"
#include "picture/display.glsl"
#include "picture/tone_curves.glsl"

layout(local_size_x = PIXEL_GROUP_SIZE, local_size_y = PIXEL_GROUP_SIZE) in;
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_PIXEL_FILTERED) readonly buffer PixelFilteredBlock { vec4 pixel_filtered[]; };
layout(std430, set = 0, binding = BIND_PIXEL_DISPLAY) writeonly buffer PixelDisplayBlock { uint pixel_display[]; };

// The tone curve, one of TONEMAP_*.
layout(constant_id = CONSTANT_CURVE) const uint CURVE = TONEMAP_LINEAR;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    uint pixel_ix = pixel.y * frame.width + pixel.x;
    vec3 encoded = srgb_encode(tone_mapped(CURVE, pixel_filtered[pixel_ix].rgb, frame.exposure));
    uvec3 bytes = uvec3(encoded * 255.0 + 0.5);
    pixel_display[pixel_ix] = bytes.r | bytes.g << 8 | bytes.b << 16 | 0xff000000u;
}
