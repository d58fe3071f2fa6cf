// What the kernels share that compute a kd-tree's slabs (src/passes/kd_slabs.rs). The terms:
//
//   entry       an entry of `leaf_triangles`. Entries are in depth-first order, so those below a node are consecutive.
//   piece       of an entry: the part of its triangle within its margin of its leaf's cell
//   candidate   a node that gets a slab if the pieces below it are flat enough. On each path from the root, these are
//               the first splits with at most 8, 32, 128, 512 and 2048 entries below them, and leaves of 2 to 2048
//               entries.
//   scaled      world units times `world_scale`, a power of two. No scaled coordinate of the root's cell exceeds 4.
//
// Kernels over nodes or entries have workgroups of SCAN_GROUP_SIZE invocations, each for one node or entry. A kernel
// defines KD_SLAB_NODE_ACCESS as the qualifier of `nodes`.
#ifndef KDRAY_SLAB_BUILD
#define KDRAY_SLAB_BUILD

#include "layout.glsl"

#ifndef KD_SLAB_NODE_ACCESS
#define KD_SLAB_NODE_ACCESS readonly
#endif

layout(std430, set = 0, binding = BIND_KD_SLAB_TREE) readonly buffer TreeBlock { KdSlabTree tree; };
layout(std430, set = 0, binding = BIND_KD_SLAB_NODES) KD_SLAB_NODE_ACCESS buffer NodesBlock { KdNode nodes[]; };

const uint NO_NODE = 0xffffffffu;

// The index of the invocation's node or entry. In the last row of workgroups, it may be beyond the last one.
uint invocation_ix() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return group * SCAN_GROUP_SIZE + gl_LocalInvocationIndex;
}

bool is_leaf(KdNode node) {
    return (node.axis_and_child & KD_LEAF) != 0u;
}

// The first child of a split.
uint child_of(KdNode node) {
    return 2u * (node.axis_and_child >> KD_PAIR_SHIFT);
}

float greatest(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

// The largest coordinate of the root's cell (world units). It is a normal float.
float largest_of_cell() {
    return greatest(max(abs(tree.box_min), abs(tree.box_max)));
}

// The power of two that scales the largest coordinate to between 2 and 4.
float world_scale() {
    return uintBitsToFloat((255u - (floatBitsToUint(largest_of_cell()) >> 23)) << 23);
}

// The centre of a box (world units) in scaled units.
vec3 scaled_centre(vec3 box_min, vec3 box_max) {
    float scale = world_scale();
    return 0.5 * (scale * box_min + scale * box_max);
}

// The finest scale whose length is not below `extent` (world units): the exponent of largest / extent. Exactly that of
// the host (`Scales::of_length`), as no division rounds.
uint scale_of_length(float extent) {
    const uint MANTISSA = 0x7fffffu;
    uint a = floatBitsToUint(tree.largest), b = floatBitsToUint(extent);
    int exponent = int(a >> 23) - int(b >> 23) - ((a & MANTISSA) < (b & MANTISSA) ? 1 : 0);
    return min(uint(max(exponent, 0)), tree.finest_scale);
}

// 2^-scale
float length_of(uint scale) {
    return uintBitsToFloat((127u - scale) << 23);
}

#endif
