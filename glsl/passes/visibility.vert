#version 460
#extension GL_GOOGLE_include_directive : require
// Visibility (the paper's section 2.2): one invocation per vertex projects a corner of a triangle. The vertex's index
// is 3 times the triangle's index plus the corner's number, 0 to 2.
// Reads triangles; passes the triangle's index on to visibility.frag, flat: a fragment gets that of the drawn
// triangle's first vertex. The other two vertices may be shared with other triangles (src/buffers/vertex_indices.rs).
#include "layout.glsl"
#include "scene.glsl"

layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };

layout(location = 0) flat out uint triangle_ix;

void main() {
    triangle_ix = uint(gl_VertexIndex) / 3u;
    place(triangle_ix);
    vec3 position_world = corner_at(triangle_ix, uint(gl_VertexIndex) % 3u).xyz;
    gl_Position = frame.clip_from_world * vec4(position_world, 1.0);
    // Behind the far plane, all three corners at one point.
    if (!is_for_camera()) gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
}
