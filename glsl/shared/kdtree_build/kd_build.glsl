// The state of a kd-tree's build, which its kernels hand to one another (src/passes/kdtree). The terms of the build:
//
//   level      the cells at one depth of the tree that have references
//   cell       a node's box. It is open until its kernels have split it or made it a leaf
//   reference  a triangle in a cell; those of a cell are side by side, by ascending triangles
//   pair       the two children of a split. Pair 0 is the root and an unused node
//   block      KD_BLOCK_SIZE consecutive triangles or references. A workgroup takes them in KD_ROWS rows of one per
//              invocation
//   group      SCAN_GROUP_SIZE consecutive cells, references, pairs or entries, one for each invocation of a workgroup
//   cutoff     the first cell of the first group of a level's cells whose children would pass a capacity
#ifndef KDRAY_KD_BUILD
#define KDRAY_KD_BUILD

#include "layout.glsl"

layout(push_constant) uniform StageBlock { KdStage stage; };
layout(std430, set = 0, binding = BIND_KD_BUILD) buffer BuildBlock { KdBuild build; };
layout(std430, set = 0, binding = BIND_KD_LEVELS) buffer LevelsBlock { KdLevel levels[]; };

// The number of blocks of n_entries entries.
uint blocks_of(uint n_entries) {
    return (n_entries + KD_BLOCK_SIZE - 1u) / KD_BLOCK_SIZE;
}

// The number of groups of n entries.
uint groups_over(uint n) {
    return (n + SCAN_GROUP_SIZE - 1u) / SCAN_GROUP_SIZE;
}

// The index of the workgroup. In the last row of workgroups, it may be beyond the last block or cell.
uint index_of_group() {
    return gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
}

// The index of the invocation's entry among those of all groups. It may be beyond the last entry.
uint index_of_entry() {
    return index_of_group() * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
}

// The size of a dispatch of n workgroups or a few more.
uvec3 dispatch_of(uint n) {
    return uvec3(min(n, KD_GROUPS_X), (n + KD_GROUPS_X - 1u) / KD_GROUPS_X, 1u);
}

// Whether a split may be cheaper than a leaf in a cell of n references of the level. A split costs at least one step.
bool may_split(uint n) {
    precise float leaf_cost = build.intersection_cost * float(n);
    return leaf_cost > build.traversal_cost && stage.level_ix < build.max_depth;
}

// Whether all components are finite. Tests the bits, since a compiler may assume that no number is NaN.
bool is_finite(vec3 v) {
    return all(notEqual(floatBitsToUint(v) & 0x7f800000u, uvec3(0x7f800000u)));
}

// Whether all corners are finite.
bool is_finite(Triangle triangle) {
    return is_finite(triangle.v0) && is_finite(triangle.v1) && is_finite(triangle.v2);
}

vec3 least_of(Triangle triangle) {
    return min(triangle.v0, min(triangle.v1, triangle.v2));
}

vec3 greatest_of(Triangle triangle) {
    return max(triangle.v0, max(triangle.v1, triangle.v2));
}

// The greatest magnitude of a coordinate of a box.
float largest_of(vec3 least, vec3 greatest) {
    vec3 largest = max(abs(least), abs(greatest));
    return max(largest.x, max(largest.y, largest.z));
}

// Maps a float to an integer of the same order: a negative number has all bits inverted, any other only its sign bit.
uint ordered(float x) {
    uint bits = floatBitsToUint(x);
    return bits ^ (bits > 0x7fffffffu ? 0xffffffffu : 0x80000000u);
}

float from_ordered(uint bits) {
    return uintBitsToFloat(bits ^ (bits > 0x7fffffffu ? 0x80000000u : 0xffffffffu));
}

// The bounds of all finite triangles, zeros if there are none.
void exact_bounds(out vec3 least, out vec3 greatest) {
    least = vec3(from_ordered(build.least_x), from_ordered(build.least_y), from_ordered(build.least_z));
    greatest = vec3(from_ordered(build.greatest_x), from_ordered(build.greatest_y), from_ordered(build.greatest_z));
    if (build.n_finite == 0u) {
        least = vec3(0.0);
        greatest = vec3(0.0);
    }
}

#endif
