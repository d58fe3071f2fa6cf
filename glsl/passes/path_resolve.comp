#version 460
#extension GL_GOOGLE_include_directive : require
// Path resolve: one invocation per pixel of the batch sums the radiance of the pixel's paths, and in w their squared
// luminance.
// Reads path_states; writes pixel_radiance.
#include "layout.glsl"
#include "rays/paths.glsl"
#include "picture/noise.glsl"
#include "picture/sample_sums.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_PATH_STATES) readonly buffer PathStatesBlock { vec4 path_states[]; };
layout(std430, set = 0, binding = BIND_PIXEL_RADIANCE) writeonly buffer PixelRadianceBlock { vec4 pixel_radiance[]; };

void main() {
    uint place = gl_GlobalInvocationID.x;
    if (place >= batch.n_pixels) return;
    uint n_samples = 1u << frame.samples_log2;
    for (uint sample_ix = 0u; sample_ix < n_samples; ++sample_ix) {
        vec3 radiance = path_states[path_of(place, sample_ix)].xyz;
        add_sample(sample_ix, vec4(radiance, squared_luminance(radiance)));
    }
    pixel_radiance[pixel_ix_of(pixel_at(place))] = sample_sums[frame.samples_log2];
}
