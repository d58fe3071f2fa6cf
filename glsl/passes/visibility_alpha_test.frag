#version 460
#extension GL_GOOGLE_include_directive : require
// Visibility in scenes with masked or single-sided materials: one invocation per fragment does what visibility.frag
// does, but discards the fragment where its triangle is cut out at the hit that primary_hit.comp will compute, or shows
// the back face of a single-sided material. (A fragment shader that can discard would slow down all other scenes, since
// the depth test has to wait for it.) Reads triangles, triangle_materials, materials and texture_words.
#include "layout.glsl"
#include "scene.glsl"
#include "rays/camera.glsl"
#include "search/triangle.glsl"
#include "shading/alpha_test.glsl"
#include "shading/back_faces.glsl"

layout(location = 0) flat in uint triangle_ix;
layout(location = 0) out uint triangle_id;

// Whether the triangle is cut out at the hit of the fragment's ray.
bool is_cut_out() {
    uvec2 pixel = uvec2(gl_FragCoord.xy) - uvec2(frame.window_x, frame.window_y);
    Shear shear = shear_of(camera_origin(pixel), camera_direction(pixel));
    Hit hit = clamp_to_triangle(shear, triangle_at(triangle_ix), triangle_ix);
    return fails_alpha_test(triangle_ix, hit.u, hit.v, false);
}

void main() {
    place(triangle_ix);
    if (CULLS_BACK_FACES) {
        if (!gl_FrontFacing && is_single_sided(triangle_ix)) discard;
    }
    if (ALPHA_MASKS) {
        if (is_cut_out()) discard;
    }
    triangle_id = triangle_ix;
}
