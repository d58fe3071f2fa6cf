#version 460
#extension GL_GOOGLE_include_directive : require
// Visibility (the paper's section 2.2): one vertex an invocation, three a triangle, no index buffer.
// Reads triangles; the triangle's index goes on, flat, to visibility.frag.
#include "layout.glsl"
#include "scene.glsl"

layout(location = 0) flat out uint triangle_ix;

void main() {
    triangle_ix = uint(gl_VertexIndex) / 3u;
    gl_Position = frame.clip_from_world * vec4(corner_at(uint(gl_VertexIndex)), 1.0);
}
