#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
// Driver: one invocation per ray that hits something stores the ray's closest hit in the payload of driver.rgen.
#include "layout.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;
hitAttributeEXT vec2 weights;

void main() {
    hit = Hit(gl_HitTEXT, uint(gl_PrimitiveID), weights.x, weights.y);
}
