#version 460
#extension GL_GOOGLE_include_directive : require
// Present: one invocation per pixel of the desktop window shows the picture, scaled to the window's size.
// Reads pixel_display; writes the window's image.
#include "layout.glsl"

layout(std430, set = 0, binding = BIND_PIXEL_DISPLAY) readonly buffer PixelDisplayBlock { uint pixel_display[]; };
layout(push_constant) uniform PresentBlock { Present present; };
layout(location = 0) out vec4 window;

// The picture's colour at a pixel, or at the nearest pixel of its border.
vec4 displayed(uvec2 pixel) {
    uvec2 inside = min(pixel, uvec2(present.width, present.height) - 1u);
    return unpackUnorm4x8(pixel_display[inside.y * present.width + inside.x]);
}

// Interpolates bilinearly between the four nearest pixels. If both sizes are equal, the weights are 0 and 1 except
// for rounding, so the window shows the picture's own bytes.
void main() {
    vec2 at = gl_FragCoord.xy * vec2(present.width, present.height) / vec2(present.window_width, present.window_height);
    vec2 corner = max(at - 0.5, 0.0);
    uvec2 pixel = uvec2(corner);
    vec2 weight = corner - vec2(pixel);
    vec4 upper = mix(displayed(pixel), displayed(pixel + uvec2(1u, 0u)), weight.x);
    vec4 lower = mix(displayed(pixel + uvec2(0u, 1u)), displayed(pixel + uvec2(1u, 1u)), weight.x);
    window = mix(upper, lower, weight.y);
}
