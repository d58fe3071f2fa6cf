#version 460
#extension GL_GOOGLE_include_directive : require
// Path begin: one invocation per path of the batch makes its camera ray.
// Writes rays, path_states, shadow rays (none), live_paths (all paths, the list of bounce 0).
#include "layout.glsl"
#include "rays/paths.glsl"
#include "rays/path_camera.glsl"
#include "rays/store.glsl"

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_LIVE_PATHS) writeonly buffer LivePathsBlock { uint live_paths[]; };
layout(std430, set = 0, binding = BIND_PATH_STATES) writeonly buffer PathStatesBlock { vec4 path_states[]; };
layout(std430, set = 0, binding = BIND_SHADOW_RAYS) writeonly buffer ShadowRaysBlock { ShadowRay shadow_rays[]; };

void main() {
    uint path_ix = gl_GlobalInvocationID.x;
    if (path_ix >= batch.n_pixels << frame.samples_log2) return;
    uvec2 pixel = pixel_of_path(path_ix);
    SampleKey key = key_of_path(path_ix, pixel);
    store_ray(path_ix, path_camera_ray(pixel, random_pair(key, 0u), random_pair(key, 1u)));
    path_states[path_ix] = vec4(0.0);
    shadow_rays[path_ix].state = SHADOW_RAY_NONE;
    live_paths[path_ix] = path_ix;
}
