#version 460
#extension GL_GOOGLE_include_directive : require
// Visibility (the paper's section 2.2): one vertex an invocation, number 3 * triangle + corner.
// Reads triangles; the triangle's index goes on, flat, to visibility.frag: that of the vertex that the triangle drawn
// begins with.
#include "layout.glsl"
#include "scene.glsl"

layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };

layout(location = 0) flat out uint triangle_ix;

void main() {
    triangle_ix = uint(gl_VertexIndex) / 3u;
    vec3 position_world = load_triangles(uint(gl_VertexIndex)).xyz;
    gl_Position = frame.clip_from_world * vec4(position_world, 1.0);
}
