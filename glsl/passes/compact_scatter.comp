#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Compact, 3 of 3: one invocation per ray of the bounce, in workgroups of SCAN_GROUP_SIZE, writes the child rays that
// start at its hit to the queue, in order and without gaps (after Harris, Sengupta, Owens: Parallel Prefix Sum (Scan)
// with CUDA, GPU Gems 3).
// Reads rays, hits, child_flags, scan_blocks, bounces and the scene; writes first_children and the next bounce's
// rays.
#include "layout.glsl"
#include "rays/rays.glsl"
#include "shading/children.glsl"
#include "scan.glsl"
#include "rays/store.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_HITS) readonly buffer HitsBlock { Hit hits[]; };
layout(std430, set = 0, binding = BIND_BOUNCES) readonly buffer BouncesBlock { Bounce bounces[]; };
layout(std430, set = 0, binding = BIND_CHILD_FLAGS) readonly buffer ChildFlagsBlock { uint child_flags[]; };
layout(std430, set = 0, binding = BIND_FIRST_CHILDREN) writeonly buffer FirstChildrenBlock { uint first_children[]; };
layout(std430, set = 0, binding = BIND_SCAN_BLOCKS) readonly buffer ScanBlocksBlock { uint scan_blocks[]; };

// Writes a ray's children to the queue from child_ix on, the reflected one first.
void make_children(uint ray_ix, uint flags, uint child_ix) {
    PathRay ray = ray_at(ray_ix);
    Hit hit = hits[ray_ix];
    Surface surface;
    Scattering next = scattering_at(ray, hit, surface);
    if ((flags & CHILD_REFLECTED) != 0u) {
        store_ray(child_ix, child_ray(surface, next.reflected, hit, ray, next.reflected_weight, true));
        child_ix += 1u;
    }
    if ((flags & CHILD_TRANSMITTED) != 0u) {
        bool is_deeper = !next.passes_straight;
        store_ray(child_ix, child_ray(surface, next.transmitted, hit, ray, next.transmitted_weight, is_deeper));
    }
}

void main() {
    uint place = gl_WorkGroupID.x * SCAN_GROUP_SIZE + scan_rank();
    uint ray_ix = bounces[batch.bounce_ix].first_ray + place;
    bool is_ray = place < bounces[batch.bounce_ix].n_rays && bounces[batch.bounce_ix + 1u].overflow == 0u;
    uint flags = is_ray ? child_flags[ray_ix] : 0u;
    uint n_children;
    uint before = workgroup_exclusive_add(uint(bitCount(flags)), n_children);
    if (!is_ray) return;
    uint child_ix = bounces[batch.bounce_ix + 1u].first_ray + scan_blocks[gl_WorkGroupID.x] + before;
    first_children[ray_ix] = child_ix;
    if (flags != 0u) make_children(ray_ix, flags, child_ix);
}
