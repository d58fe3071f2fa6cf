#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Compact, 2 of 3: the only workgroup turns the sums of the blocks of SCAN_GROUP_SIZE rays into exclusive prefix sums
// and sizes the next bounce. A block of paths has two sums: of paths that go on, and of shadow rays. If the queue has
// no room for the next bounce's rays, that bounce is empty and its `overflow` is set, as is `any_overflow` of the first
// row of bounces. Reads and writes scan_blocks and bounces.
#include "layout.glsl"
#include "integrator.glsl"
#include "scan.glsl"

layout(local_size_x_id = CONSTANT_SCAN_SIZE) in;
layout(push_constant) uniform BatchBlock { Batch batch; };
layout(std140, set = 0, binding = BIND_FRAME) uniform FrameBlock { Frame frame; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) buffer ScanBlocksBlock { uint scan_blocks[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) buffer BouncesBlock { Bounce bounces[]; };

// The base-2 logarithm of the number of lanes that each of n_rays rays gets. Twin of `lanes_log2` in
// src/frame/bounce.rs.
uint lanes_log2(uint n_rays) {
    uint n_lanes = frame.n_lanes / max(n_rays, 1u);
    return n_lanes == 0u ? 0u : min(uint(findMSB(n_lanes)), MOST_LANES_LOG2);
}

uint groups_for(uint n_invocations, uint group_size) {
    return (n_invocations + group_size - 1u) / group_size;
}

// Sizes the next bounce of paths. n_paths: the paths that go on. n_shadow_rays: the shadow rays of this bounce, which
// the next dispatch traces, too.
void size_next_bounce_of_paths(uint n_paths, uint n_shadow_rays) {
    uint next_ix = batch.bounce_ix + 1u;
    uint n_traced = n_paths + n_shadow_rays;
    uint for_rays = lanes_log2(n_traced);
    bounces[batch.bounce_ix].n_shadow_rays = n_shadow_rays;
    bounces[next_ix].n_rays = n_paths;
    bounces[next_ix].n_wanted = n_paths;
    bounces[next_ix].trace_groups_x = groups_for(n_traced << for_rays, RAY_GROUP_SIZE);
    bounces[next_ix].trace_lanes_log2 = for_rays;
    bounces[next_ix].scan_groups_x = groups_for(n_paths, SCAN_GROUP_SIZE);
}

void size_next_bounce(uint n_wanted) {
    uint next_ix = batch.bounce_ix + 1u;
    uint first_ray = bounces[batch.bounce_ix].first_ray + bounces[batch.bounce_ix].n_rays;
    uint n_rays = n_wanted <= frame.queue_capacity - first_ray ? n_wanted : 0u;
    bounces[next_ix].first_ray = first_ray;
    bounces[next_ix].n_rays = n_rays;
    bounces[next_ix].n_wanted = n_wanted;
    bounces[next_ix].overflow = n_rays == n_wanted ? 0u : 1u;
    if (n_rays != n_wanted) bounces[0].any_overflow = 1u;
    uint n_so_far = first_ray + n_rays;
    uint for_rays = lanes_log2(n_rays);
    uint for_shadow_rays = lanes_log2(n_so_far * frame.n_lights);
    bounces[next_ix].trace_groups_x = groups_for(n_rays << for_rays, RAY_GROUP_SIZE);
    bounces[next_ix].trace_lanes_log2 = for_rays;
    bounces[next_ix].shadow_groups_x = groups_for(n_so_far << for_shadow_rays, RAY_GROUP_SIZE);
    bounces[next_ix].shadow_lanes_log2 = for_shadow_rays;
    bounces[next_ix].scan_groups_x = groups_for(n_rays, SCAN_GROUP_SIZE);
    bounces[next_ix].shade_groups_x = groups_for(n_so_far, RAY_GROUP_SIZE);
}

// The counts of a block. Without paths, the second one is 0.
uvec2 counts_of(uint block) {
    return PATHS ? uvec2(scan_blocks[2u * block], scan_blocks[2u * block + 1u]) : uvec2(scan_blocks[block], 0u);
}

void store_counts(uint block, uvec2 counts) {
    scan_blocks[PATHS ? 2u * block : block] = counts.x;
    if (PATHS) scan_blocks[2u * block + 1u] = counts.y;
}

// Does what `workgroup_exclusive_add` does for both counts.
uvec2 exclusive_add_counts(uvec2 counts, out uvec2 total) {
    uvec2 before = uvec2(0u);
    total = uvec2(0u);
    before.x = workgroup_exclusive_add(counts.x, total.x);
    if (PATHS) before.y = workgroup_exclusive_add(counts.y, total.y);
    return before;
}

// Subgroups go through the blocks in chunks of SPINE_ITEMS rows. A row has a block for each invocation of the subgroup,
// so that the loads of a row are next to each other.
void main() {
    uint n_blocks = bounces[batch.bounce_ix].scan_groups_x;
    uvec2 carry = uvec2(0u);
    for (uint first = 0u; first < n_blocks; first += SCAN_SIZE * SPINE_ITEMS) {
        uint begin = first + gl_SubgroupID * gl_SubgroupSize * SPINE_ITEMS + gl_SubgroupInvocationID;
        // All counts are loaded before the first is used, so that no load waits for another.
        uvec2 counts[SPINE_ITEMS];
        for (uint i = 0u; i < SPINE_ITEMS; ++i) {
            uint block = begin + i * gl_SubgroupSize;
            counts[i] = block < n_blocks ? counts_of(block) : uvec2(0u);
        }
        // The counts become their prefix sums within the chunk.
        uvec2 of_chunk = uvec2(0u);
        for (uint i = 0u; i < SPINE_ITEMS; ++i) {
            uvec2 before = of_chunk + subgroupExclusiveAdd(counts[i]);
            of_chunk += subgroupAdd(counts[i]);
            counts[i] = before;
        }
        // Only the last invocation of a subgroup contributes, with the sum of its chunk. So each invocation gets the
        // sum of all chunks before its own.
        bool is_last = gl_SubgroupInvocationID == gl_SubgroupSize - 1u;
        uvec2 total;
        uvec2 before_chunk = carry + exclusive_add_counts(is_last ? of_chunk : uvec2(0u), total);
        for (uint i = 0u; i < SPINE_ITEMS; ++i) {
            uint block = begin + i * gl_SubgroupSize;
            if (block < n_blocks) store_counts(block, before_chunk + counts[i]);
        }
        carry += total;
    }
    if (gl_LocalInvocationIndex != 0u) return;
    if (PATHS) size_next_bounce_of_paths(carry.x, carry.y);
    else size_next_bounce(carry.x);
}
