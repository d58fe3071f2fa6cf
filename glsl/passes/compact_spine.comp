#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Compact, 2 of 3: one workgroup turns the blocks' sums into their exclusive prefix sums and sizes the next bounce.
// Where the queue cannot hold that many rays, the next bounce is empty and says `overflow`, and the first row `any_overflow`.
// Reads and writes scan_blocks, bounces.
#include "layout.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) buffer ScanBlocksBlock { uint scan_blocks[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) buffer BouncesBlock { Bounce bounces[]; };

// As src/bounce.rs has it.
uint lanes_log2(uint n_rays) {
    uint n_lanes = frame.n_lanes / max(n_rays, 1u);
    return n_lanes == 0u ? 0u : min(uint(findMSB(n_lanes)), MOST_LANES_LOG2);
}

uint groups_for(uint n_invocations) {
    return (n_invocations + RAY_GROUP_SIZE - 1u) / RAY_GROUP_SIZE;
}

void size_next_bounce(uint n_wanted) {
    uint n_rays = n_wanted <= frame.queue_capacity ? n_wanted : 0u;
    uint next_ix = batch.bounce_ix + 1u;
    bounces[next_ix].overflow = n_rays == n_wanted ? 0u : 1u;
    if (n_rays != n_wanted) bounces[0].any_overflow = 1u;
    bounces[next_ix].n_wanted = n_wanted;
    bounces[next_ix].n_rays = n_rays;
    uint for_rays = lanes_log2(n_rays);
    uint for_segments = lanes_log2(n_rays * frame.n_lights);
    bounces[next_ix].ray_groups_x = groups_for(n_rays);
    bounces[next_ix].trace_groups_x = groups_for(n_rays << for_rays);
    bounces[next_ix].trace_lanes_log2 = for_rays;
    bounces[next_ix].shadow_groups_x = groups_for(n_rays << for_segments);
    bounces[next_ix].shadow_lanes_log2 = for_segments;
    bounces[next_ix].scan_groups_x = (n_rays + SCAN_BLOCK_SIZE - 1u) / SCAN_BLOCK_SIZE;
}

void main() {
    uint n_blocks = bounces[batch.bounce_ix].scan_groups_x;
    uint carry = 0u;
    for (uint first = 0u; first < n_blocks; first += SCAN_GROUP_SIZE) {
        uint block = first + scan_rank();
        uint total;
        uint before = workgroup_exclusive_add(block < n_blocks ? scan_blocks[block] : 0u, total);
        if (block < n_blocks) scan_blocks[block] = carry + before;
        carry += total;
    }
    if (gl_LocalInvocationIndex == 0u) size_next_bounce(carry);
}
