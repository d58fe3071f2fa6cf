#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Compact, 1 of 3: one workgroup adds up the child counts of one block of SCAN_BLOCK_SIZE rays.
// Reads child_counts, bounces; writes scan_blocks[block].
#include "layout.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std430, set = 0, binding = BIND_CHILD_COUNTS) readonly buffer ChildCountsBlock { uint child_counts[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) writeonly buffer ScanBlocksBlock { uint scan_blocks[]; };

void main() {
    uint n_rays = bounces[batch.bounce_ix].n_rays;
    uint first_ray = gl_WorkGroupID.x * SCAN_BLOCK_SIZE;
    uint sum = 0u;
    for (uint i = 0u; i < SCAN_ITEMS; ++i) {
        uint ray_ix = first_ray + i * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
        if (ray_ix < n_rays) sum += child_counts[ray_ix];
    }
    uint total;
    workgroup_exclusive_add(sum, total);
    if (gl_LocalInvocationIndex == 0u) scan_blocks[gl_WorkGroupID.x] = total;
}
