#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Path scatter: one invocation per path that is alive at the bounce. It adds the light that the path's ray meets,
// samples a light at the hit, to which the next dispatch of path_trace.comp traces a shadow ray, and samples the
// direction in which the path goes on. Each workgroup counts those of its SCAN_GROUP_SIZE paths that go on, and those
// that have a shadow ray. Reads hits, live_paths, bounces and the scene; updates rays and path_states; writes shadow
// rays, child_flags (whether the path at a place of the list goes on and has a shadow ray) and scan_blocks[workgroup].
#include "layout.glsl"
#include "rays/paths.glsl"
#include "scan.glsl"
#include "rays/store.glsl"
#include "shading/path_vertex.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_LIVE_PATHS) readonly buffer LivePathsBlock { uint live_paths[]; };
layout(std430, set = 0, binding = BIND_RAYS) readonly buffer RaysBlock { PathRay rays[]; };
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_CHILD_FLAGS) writeonly buffer ChildFlagsBlock { uint child_flags[]; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) writeonly buffer ScanBlocksBlock { uvec2 scan_blocks[]; };
layout(std430, set = 0, binding = BIND_PATH_STATES) buffer PathStatesBlock { vec4 path_states[]; };
layout(std430, set = 0, binding = BIND_SHADOW_RAYS) writeonly buffer ShadowRaysBlock { uvec4 stored_shadow_rays[]; };

void store_shadow_ray(uint path_ix, ShadowRay shadow_ray) {
    stored_shadow_rays[3u * path_ix] = words_of(shadow_ray.origin, shadow_ray.state);
    stored_shadow_rays[3u * path_ix + 1u] = words_of(shadow_ray.direction, shadow_ray.source_triangle);
    stored_shadow_rays[3u * path_ix + 2u] = words_of(shadow_ray.light, floatBitsToUint(shadow_ray.t_max));
}

// Takes a path one bounce further. Returns whether it goes on and has a shadow ray, for `child_flags`.
uint scatter(uint path_ix) {
    uvec2 pixel = pixel_of_path(path_ix);
    PathRay ray = rays[path_ix];
    vec4 words = path_states[path_ix];
    PathState state = PathState(words.xyz, words.w);
    ShadowRay shadow_ray;
    bool goes_on = scatter_path(key_of_path(path_ix, pixel), batch.depth, hits[path_ix], ray, state, shadow_ray);
    path_states[path_ix] = vec4(state.radiance, state.pdf);
    // A path without a shadow ray has none already: path_trace.comp has cleared the last one.
    if (shadow_ray.state != SHADOW_RAY_NONE) store_shadow_ray(path_ix, shadow_ray);
    if (goes_on) store_ray(path_ix, ray);
    return (goes_on ? PATH_GOES_ON : 0u) | (shadow_ray.state != SHADOW_RAY_NONE ? PATH_HAS_SHADOW_RAY : 0u);
}

void main() {
    uint place = gl_GlobalInvocationID.x;
    uint flags = 0u;
    if (place < bounces[batch.bounce_ix].n_rays) {
        flags = scatter(live_paths[list_of(batch.depth) + place]);
        child_flags[place] = flags;
    }
    uint n_of_group;
    workgroup_exclusive_add(flags, n_of_group);
    if (gl_LocalInvocationIndex == 0u) scan_blocks[gl_WorkGroupID.x] = halves_of(n_of_group);
}
