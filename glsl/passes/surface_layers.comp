#version 460
#extension GL_GOOGLE_include_directive : require
// Surface layers: one invocation per pixel of the batch and layer sums what the camera rays of the frame's samples of
// the pixel hit: the albedo (y = 0) or the shading normal (y = 1). A sample that hits nothing, or of a path a lamp,
// adds 0. The sums are those of path_accumulate.comp. Noise filters of other programs use their means.
// Reads hits, the rays of paths, and the scene; writes the layers' parts of pixel_radiance.
#include "layout.glsl"
#include "rays/rays.glsl"
#include "shading/path_vertex.glsl"
#include "picture/sample_sums.glsl"

// The layer of `pixel_radiance` that has the albedo. The picture itself is layer 0.
layout(constant_id = CONSTANT_FIRST_SURFACE_LAYER) const uint FIRST_SURFACE_LAYER = 1u;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) writeonly buffer PixelRadianceBlock { vec4 pixel_radiance[]; };

// The albedo or the normal of what a camera ray hits.
vec3 value_at(PathRay ray, Hit hit, bool is_albedo) {
    if (hit.triangle_ix == NO_TRIANGLE) return vec3(0.0);
    if (PATHS && !isinf(seen_light(ray.origin, ray.direction, hit.t).t)) return vec3(0.0);
    Surface surface;
    Material material;
    shaded_at(ray, hit, surface, material);
    vec3 value = is_albedo ? hit_albedo(material) : surface.shading;
    // Textures of floats can have any value.
    return all(lessThan(abs(value), vec3(INFINITY))) ? value : vec3(0.0);
}

void main() {
    uint place = gl_GlobalInvocationID.x;
    uint layer_ix = gl_GlobalInvocationID.y;
    if (place >= batch.n_pixels) return;
    uint samples_log2 = PATHS ? frame.samples_log2 : 0u;
    for (uint sample_ix = 0u; sample_ix < 1u << samples_log2; ++sample_ix) {
        uint ray_ix = first_ray_of(place) + sample_ix;
        add_sample(sample_ix, vec4(value_at(ray_at(ray_ix), hits[ray_ix], layer_ix == 0u), 1.0));
    }
    uint layer_begin = (FIRST_SURFACE_LAYER + layer_ix) * frame.width * frame.height;
    pixel_radiance[layer_begin + pixel_ix_of(pixel_of_ray(place))] = sample_sums[samples_log2];
}
