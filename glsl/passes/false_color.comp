#version 460
#extension GL_GOOGLE_include_directive : require
// False colour: one invocation per pixel of the window, in squares, displays one of the pixel's AOVs (VIEW_*) in
// place of its colour.
// Reads pixel_aovs; writes pixel_display (R in the lowest byte).
#include "layout.glsl"
#include "picture/false_color.glsl"

layout(local_size_x = PIXEL_GROUP_SIZE, local_size_y = PIXEL_GROUP_SIZE) in;
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_PIXEL_AOVS) readonly buffer PixelAovsBlock { PixelAovs pixel_aovs[]; };
layout(std430, set = 0, binding = BIND_PIXEL_DISPLAY) writeonly buffer PixelDisplayBlock { uint pixel_display[]; };
layout(push_constant) uniform FalseColorBlock { FalseColor push; };

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= frame.width || pixel.y >= frame.height) return;
    uint pixel_ix = pixel.y * frame.width + pixel.x;
    vec3 color = false_color(pixel_aovs[pixel_ix], push.view, push.brightest);
    uvec3 bytes = uvec3(clamp(color, 0.0, 1.0) * 255.0 + 0.5);
    pixel_display[pixel_ix] = bytes.r | bytes.g << 8 | bytes.b << 16 | 0xff000000u;
}
