#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Compact, 3 of 3: one workgroup moves the children of one block of rays to their places in the next queue, in order
// (after Harris, Sengupta, Owens: Parallel Prefix Sum (Scan) with CUDA, GPU Gems 3).
// Reads child_rays, child_counts, scan_blocks, bounces; writes next_rays.
#include "layout.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std430, set = 0, binding = BIND_CHILD_RAYS) readonly buffer ChildRaysBlock { Ray child_rays[]; };
layout(std430, set = 0, binding = BIND_CHILD_COUNTS) readonly buffer ChildCountsBlock { uint child_counts[]; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uint scan_blocks[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_NEXT_RAYS) writeonly buffer NextRaysBlock { Ray next_rays[]; };

void main() {
    uint n_rays = bounces[batch.bounce_ix].n_rays;
    uint place = scan_blocks[gl_WorkGroupID.x];
    bool has_room = bounces[batch.bounce_ix + 1u].overflow == 0u;
    for (uint i = 0u; i < SCAN_ITEMS; ++i) {
        uint ray_ix = gl_WorkGroupID.x * SCAN_BLOCK_SIZE + i * SCAN_GROUP_SIZE + scan_rank();
        uint n_children = has_room && ray_ix < n_rays ? child_counts[ray_ix] : 0u;
        uint total;
        uint before = workgroup_exclusive_add(n_children, total);
        for (uint child = 0u; child < n_children; ++child) {
            next_rays[place + before + child] = child_rays[2u * ray_ix + child];
        }
        place += total;
    }
}
