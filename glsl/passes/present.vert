#version 460
// Present: one invocation per vertex of a triangle that covers the window, with its right angle in the upper left
// corner.

void main() {
    vec2 corner = vec2(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
