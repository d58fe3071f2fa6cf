#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_ray_tracing : require
// Driver: one invocation per ray that hits nothing stores a miss in the payload of driver.rgen.
#include "layout.glsl"
#include "constants.glsl"

layout(location = 0) rayPayloadInEXT Hit hit;

void main() {
    hit = Hit(INFINITY, NO_TRIANGLE, 0.0, 0.0);
}
