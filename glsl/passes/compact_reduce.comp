#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Compact, 1 of 3: one invocation per ray of the bounce determines which child rays start at its hit. Each workgroup
// counts those of its SCAN_GROUP_SIZE rays.
// Reads rays, hits, bounces and the scene; writes child_flags and scan_blocks[workgroup].
#include "layout.glsl"
#include "rays/rays.glsl"
#include "shading/children.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_CHILD_FLAGS) writeonly buffer ChildFlagsBlock { uint child_flags[]; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) writeonly buffer ScanBlocksBlock { uint scan_blocks[]; };

void main() {
    uint place = gl_GlobalInvocationID.x;
    uint flags = 0u;
    if (place < bounces[batch.bounce_ix].n_rays) {
        uint ray_ix = bounces[batch.bounce_ix].first_ray + place;
        flags = child_flags_of(ray_at(ray_ix), hits[ray_ix]);
        child_flags[ray_ix] = flags;
    }
    uint n_children;
    workgroup_exclusive_add(uint(bitCount(flags)), n_children);
    if (gl_LocalInvocationIndex == 0u) scan_blocks[gl_WorkGroupID.x] = n_children;
}
