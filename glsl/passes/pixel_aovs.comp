#version 460
#extension GL_GOOGLE_include_directive : require
// Pixel AOVs: one invocation per pixel of the batch writes the AOVs of its first camera ray's hit: position, normal,
// albedo, depth and the indices of the triangle and its material.
// Reads hits and the scene; writes pixel_aovs, except n_rays and n_steps.
#include "layout.glsl"
#include "rays/rays.glsl"
#include "scene.glsl"
#include "shading/surface.glsl"
#include "shading/material.glsl"
#include "shading/maps.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_PIXEL_AOVS) buffer PixelAovsBlock { PixelAovs pixel_aovs[]; };

void main() {
    uint place = gl_GlobalInvocationID.x;
    if (place >= batch.n_pixels) return;
    uint ray_ix = first_ray_of(place);
    PathRay ray = ray_at(ray_ix);
    Hit hit = hits[ray_ix];
    uint pixel_ix = ray.pixel_ix;
    pixel_aovs[pixel_ix].triangle_ix = hit.triangle_ix;
    if (hit.triangle_ix == NO_TRIANGLE) {
        pixel_aovs[pixel_ix].material_ix = NO_TRIANGLE;
        pixel_aovs[pixel_ix].depth = INFINITY;
        return; // the vectors were cleared at the frame's start
    }
    Surface surface;
    Material material;
    shaded_at(ray, hit, surface, material);
    uint material_ix = material_ix_of(hit.triangle_ix);
    pixel_aovs[pixel_ix].position_world = surface.point_world;
    pixel_aovs[pixel_ix].normal_world = surface.shading;
    pixel_aovs[pixel_ix].material_ix = material_ix;
    pixel_aovs[pixel_ix].albedo = material.kd;
    pixel_aovs[pixel_ix].depth = dot(surface.point_world - frame.eye, frame.forward);
}
