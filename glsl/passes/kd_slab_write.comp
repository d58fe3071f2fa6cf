#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 8 of 8: writes the slabs of the candidates that are flat enough, zeros for all other nodes, and
// the marks KD_HAS_SLAB. One invocation per node.
// Reads tree, parents, ranges, patches, extents; updates nodes; writes slabs.
#define KD_SLAB_NODE_ACCESS
#include "kdtree/slab_candidates.glsl"
#include "kdtree/slab_extent.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_PATCHES) readonly buffer PatchesBlock { KdSlabPatch patches[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_EXTENTS) readonly buffer ExtentsBlock { KdSlabExtent extents[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_SLABS) writeonly buffer SlabsBlock { Slab slabs[]; };

// The reach of a slab beyond the pieces, in units of the epsilon of planes.rs at its scale. There, rounding may move a
// slab by 5 units of 2^-24 of the length of that scale. Here it moves the slab by 7: 5.2 for the height of the cell's
// centre and 1.7 for the offset. REACH makes up for that: it adds 16 units. What is left of the errors are shares of
// heights from the cell's centre, which SLACK covers (slab_pieces.glsl).
const float REACH = 1.0625;
// 1 / half is off by 5 units of 2^-24, and its product with an extent by 2 more. The thickness makes up for that.
const float THICKENING = 1.000001;
// Bounds of the largest component of a slab's normal. In between, no component that matters is denormal.
const float LEAST_COMPONENT = 7.8886e-31;
const float MOST_COMPONENT = 1.2676e30;

// The slab around a candidate's surface. Its normal is 0 if the surface is too thick or has no normal.
Slab slab_around(KdSlabPatch candidate, KdSlabExtent extent, float share) {
    Slab none = Slab(vec3(0.0), 0.0);
    if (candidate.normal == vec3(0.0)) return none;
    float scale = world_scale();
    float low = from_ordered(extent.low), high = from_ordered(extent.high);
    float longest = greatest(scale * candidate.cell_max - scale * candidate.cell_min);
    if (!(high - low <= share * longest)) return none;
    float largest = greatest(max(abs(candidate.cell_min), abs(candidate.cell_max)));
    uint slab_scale = tree.finest_scale == 0u ? 0u : min(extent.scale, scale_of_length(largest));
    float reach = REACH * KD_PLANE_EPSILON * (scale * largest_of_cell()) * length_of(slab_scale);
    float half_ = THICKENING * (0.5 * (high - low) + reach);
    vec3 normal = candidate.normal / half_;
    vec3 centre = scaled_centre(candidate.cell_min, candidate.cell_max);
    float offset = dot(normal, centre) + 0.5 * (low + high) / half_;
    vec3 in_world = normal * scale;
    float component = greatest(abs(in_world));
    return component >= LEAST_COMPONENT && component <= MOST_COMPONENT ? Slab(in_world, offset) : none;
}

void main() {
    uint node_ix = invocation_ix();
    if (node_ix >= tree.n_nodes) return;
    KdNode node = nodes[node_ix];
    float share = thickest_share(node_ix, node);
    Slab slab = Slab(vec3(0.0), 0.0);
    if (share > 0.0) slab = slab_around(patches[node_ix], extents[node_ix], share);
    slabs[node_ix] = slab;
    uint mark = slab.normal == vec3(0.0) ? 0u : KD_HAS_SLAB;
    nodes[node_ix].axis_and_child = (node.axis_and_child & ~KD_HAS_SLAB) | mark;
}
