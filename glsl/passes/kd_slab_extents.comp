#version 460
#extension GL_GOOGLE_include_directive : require
// Slabs of a kd-tree, 7 of 8: finds how far each candidate's surface reaches along its normal. One invocation per
// entry, whose piece it adds to its leaf and to all candidates above.
// Reads tree, leaf_triangles, entry_leaves, ranges, patches; updates extents.
#include "kdtree/slab_extent.glsl"
#include "kdtree/slab_pieces.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_SLAB_PATCHES) readonly buffer PatchesBlock { KdSlabPatch patches[]; };
layout(std430, set = 0, binding = BIND_KD_SLAB_EXTENTS) buffer ExtentsBlock { KdSlabExtent extents[]; };

// Adds the piece to a candidate's extent. shift: from the centre of the candidate's cell to that of the leaf's. reach:
// D of slab_pieces.glsl. With the shift, heights are off by 6 u times its largest coordinate more.
void add_piece(uint node_ix, vec3 normal, vec3 shift, float reach) {
    float low = uintBitsToFloat(0x7f800000u), high = -low;
    for (uint i = 0u; i < n_corners; ++i) {
        float height = dot(normal, corner(i) + shift);
        low = min(low, height);
        high = max(high, height);
    }
    float slack = SLACK * max(reach, greatest(abs(shift)));
    atomicMin(extents[node_ix].low, ordered(low - slack));
    atomicMax(extents[node_ix].high, ordered(high + slack));
}

void main() {
    uint entry_ix = invocation_ix();
    if (entry_ix >= tree.n_entries) return;
    uint leaf_ix = entry_leaves[entry_ix];
    if (leaf_ix == NO_NODE) return;
    KdSlabPatch leaf = patches[leaf_ix];
    LeafTriangle triangle = leaf_triangles[entry_ix];
    uint triangle_scale = scale_of_triangle(triangle);
    float reach = find_piece(triangle, triangle_scale, leaf);
    vec3 centre = scaled_centre(leaf.cell_min, leaf.cell_max);
    for (uint at = leaf_ix; at != NO_NODE;) {
        KdSlabPatch candidate = patches[at];
        // A leaf that is no candidate has the normal 0.
        if (candidate.normal != vec3(0.0)) {
            vec3 shift = centre - scaled_centre(candidate.cell_min, candidate.cell_max);
            if (n_corners > 0u) add_piece(at, candidate.normal, shift, reach);
            if (tree.finest_scale > 0u) atomicMin(extents[at].scale, triangle_scale);
        }
        at = candidate.above;
    }
}
