#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Path compact: one invocation per path of the bounce, in workgroups of SCAN_GROUP_SIZE. The paths that go on are
// listed, in order and without gaps, for the next bounce.
// Reads child_kinds (whether the path at a place of the bounce's list goes on), scan_blocks, bounces; updates
// live_paths.
#include "layout.glsl"
#include "paths.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_LIVE_PATHS) buffer LivePathsBlock { uint live_paths[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_CHILD_KINDS) readonly buffer ChildKindsBlock { uint child_kinds[]; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uint scan_blocks[]; };

void main() {
    uint place = gl_WorkGroupID.x * SCAN_GROUP_SIZE + scan_rank();
    bool goes_on = place < bounces[batch.bounce_ix].n_rays && child_kinds[place] != 0u;
    uint n_of_group;
    uint before = workgroup_exclusive_add(goes_on ? 1u : 0u, n_of_group);
    if (!goes_on) return;
    uint next_place = scan_blocks[gl_WorkGroupID.x] + before;
    live_paths[list_of(batch.depth + 1u) + next_place] = live_paths[list_of(batch.depth) + place];
}
