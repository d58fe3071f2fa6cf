#version 460
#extension GL_GOOGLE_include_directive : require
// Present: one invocation a pixel of the window shows the picture, stretched to the window where it is smaller, or one of
// the features that were found with it.
// Reads pixel_display, pixel_features; writes the window's image.
#include "layout.glsl"
#include "false_color.glsl"

layout(std430, set = 0, binding = BIND_PIXEL_DISPLAY) readonly buffer PixelDisplayBlock { uint pixel_display[]; };
layout(std430, set = 0, binding = BIND_PIXEL_FEATURES) readonly buffer PixelFeaturesBlock { Feature pixel_features[]; };
layout(push_constant) uniform PresentBlock { Present present; };
layout(location = 0) out vec4 window;

uint pixel_ix_of(uvec2 pixel) {
    uvec2 inside = min(pixel, uvec2(present.width, present.height) - 1u);
    return inside.y * present.width + inside.x;
}

vec3 displayed(uvec2 pixel) {
    return unpackUnorm4x8(pixel_display[pixel_ix_of(pixel)]).rgb;
}

// The mean of the four nearest pixels. Of equal sizes their weights are 0 and 1 but for rounding: the window shows the
// picture's own bytes.
vec3 stretched(vec2 at) {
    vec2 corner = max(at - 0.5, 0.0);
    uvec2 pixel = uvec2(corner);
    vec2 weight = corner - vec2(pixel);
    vec3 upper = mix(displayed(pixel), displayed(pixel + uvec2(1u, 0u)), weight.x);
    vec3 lower = mix(displayed(pixel + uvec2(0u, 1u)), displayed(pixel + uvec2(1u, 1u)), weight.x);
    return mix(upper, lower, weight.y);
}

void main() {
    vec2 at = gl_FragCoord.xy * vec2(present.width, present.height) / vec2(present.window_width, present.window_height);
    vec3 color;
    if (present.view == VIEW_PICTURE) {
        color = stretched(at);
    } else {
        color = false_color(pixel_features[pixel_ix_of(uvec2(at))], present.view, present.brightest);
    }
    window = vec4(color, 1.0);
}
