#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Path compact: one invocation per path of the bounce, in workgroups of SCAN_GROUP_SIZE. Two lists are written for the
// next bounce, in order and without gaps: the paths that go on, and the paths that have a shadow ray to a light. Reads
// child_flags (whether the path at a place of the bounce's list goes on and has a shadow ray), scan_blocks, bounces;
// updates live_paths.
#include "layout.glsl"
#include "rays/paths.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_LIVE_PATHS) buffer LivePathsBlock { uint live_paths[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_CHILD_FLAGS) readonly buffer ChildFlagsBlock { uint child_flags[]; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uvec2 scan_blocks[]; };

void main() {
    uint place = gl_WorkGroupID.x * SCAN_GROUP_SIZE + scan_rank();
    uint flags = place < bounces[batch.bounce_ix].n_rays ? child_flags[place] : 0u;
    uint n_of_group;
    uvec2 before = halves_of(workgroup_exclusive_add(flags, n_of_group));
    if (flags == 0u) return;
    uint path_ix = live_paths[list_of(batch.depth) + place];
    uvec2 next_place = scan_blocks[gl_WorkGroupID.x] + before;
    if ((flags & PATH_GOES_ON) != 0u) live_paths[list_of(batch.depth + 1u) + next_place.x] = path_ix;
    if ((flags & PATH_HAS_SHADOW_RAY) != 0u) live_paths[list_of_shadow_rays() + next_place.y] = path_ix;
}
