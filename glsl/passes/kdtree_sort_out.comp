#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, sort out: finds on which sides of its cell's plane each reference is. A reference that the plane cuts is
// split into two. One workgroup per block of references.
// Reads build, levels, triangles, cells_from; updates references_from; writes above, sides, scan_blocks.
#include "kdtree_build/kd_clip.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) readonly buffer CellsFromBlock { KdCell cells_from[]; };
layout(std430, set = 0, binding = BIND_KD_REFERENCES_FROM) buffer ReferencesFromBlock {
    KdReference references_from[];
};
layout(std430, set = 0, binding = BIND_KD_ABOVE) writeonly buffer AboveBlock { KdReference above[]; };
layout(std430, set = 0, binding = BIND_KD_SIDES) writeonly buffer SidesBlock { uint sides[]; };
layout(std430, set = 0, binding = BIND_KD_SCAN_BLOCKS) writeonly buffer ScanBlocksBlock { uvec4 scan_blocks[]; };

// Whether a reference is below and above its cell's plane. Neither, if the cell becomes a leaf.
bvec2 sides_of(uint reference_ix) {
    KdReference reference = references_from[reference_ix];
    KdCell cell = cells_from[reference.cell_ix];
    if (cell.axis == KD_NO_AXIS) return bvec2(false);
    if (reference.box_max[cell.axis] <= cell.position) return bvec2(true, false);
    if (reference.box_min[cell.axis] >= cell.position) return bvec2(false, true);
    KdReference part_above;
    split_reference(triangles[reference.triangle_ix], cell, reference, part_above);
    bvec2 is_on = bvec2(!is_empty(reference), !is_empty(part_above));
    // Only a reference with parts on both sides is read from two places.
    if (is_on.x) {
        references_from[reference_ix] = reference;
        above[reference_ix] = part_above;
    } else {
        references_from[reference_ix] = part_above;
    }
    return is_on;
}

void main() {
    uint block = index_of_group();
    uint n = levels[stage.level_ix].n_references;
    uint sum = 0u;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint reference_ix = block * KD_BLOCK_SIZE + row * SCAN_GROUP_SIZE + scan_rank();
        bool is_reference = reference_ix < n;
        bvec2 is_on = bvec2(false);
        if (is_reference) is_on = sides_of(reference_ix);
        uvec2 counts = uvec2(is_on);
        uint total;
        uint before = sum + workgroup_exclusive_add(counts.x | counts.y << 16, total);
        uvec2 halves = halves_of(before);
        if (is_reference) sides[reference_ix] = halves.x | halves.y << 10 | counts.x << 20 | counts.y << 21;
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u && block < blocks_of(n)) scan_blocks[block] = uvec4(halves_of(sum), 0u, 0u);
}
