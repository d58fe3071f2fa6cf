#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, scatter: writes the references of the next level, those of a child side by side and in the order of their
// parent's, and the references in the level's leaves. One workgroup per group of references.
// Reads build, levels, cells_from, references_from, above, sides, scan_blocks; writes references_to, leaf_references.
#include "kdtree_build/kd_next.glsl"
#include "kdtree_build/kd_scales.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_REFERENCES_FROM) readonly buffer ReferencesFromBlock {
    KdReference references_from[];
};
layout(std430, set = 0, binding = BIND_KD_ABOVE) readonly buffer AboveBlock { KdReference above[]; };
layout(std430, set = 0, binding = BIND_KD_REFERENCES_TO) writeonly buffer ReferencesToBlock {
    KdReference references_to[];
};
layout(std430, set = 0, binding = BIND_KD_LEAF_REFERENCES) writeonly buffer LeafReferencesBlock {
    uvec2 leaf_references[];
};

void write_to_children(KdReference reference, KdCell cell, uint reference_ix) {
    uvec2 before = sides_before(reference_ix);
    uint child_ix = before_cell(cell, reference.cell_ix).y;
    uint word = sides[reference_ix];
    bool is_below = (word & 1u << 20) != 0u, is_above = (word & 1u << 21) != 0u;
    if (is_below) {
        reference.cell_ix = child_ix;
        references_to[before.x + cell.below_offset] = reference;
    }
    if (!is_above) return;
    if (is_below) reference = above[reference_ix];
    reference.cell_ix = child_ix + (cell.n_below > 0u ? 1u : 0u);
    references_to[before.y + cell.above_offset] = reference;
}

void main() {
    uint reference_ix = index_of_entry();
    if (reference_ix >= levels[stage.level_ix].n_references) return;
    KdReference reference = references_from[reference_ix];
    KdCell cell = cells_from[reference.cell_ix];
    if (is_split(cell, reference.cell_ix)) {
        write_to_children(reference, cell, reference_ix);
        return;
    }
    uint place = in_leaves_before(cell, reference.cell_ix) + reference_ix - cell.first;
    uint scale = scale_of(cell.box_min, cell.box_max);
    leaf_references[place] = uvec2(reference.triangle_ix, cell.node_ix | scale << 27);
}
