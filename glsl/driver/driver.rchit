#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
// Driver: one invocation per ray that hits something stores the closest hit of the ray of driver.rgen in its payload.
#include "layout.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;
hitAttributeEXT vec2 weights;

void main() {
    hit = Hit(gl_HitTEXT, uint(gl_PrimitiveID), weights.x, weights.y);
}
