#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, sort out: finds on which sides of its cell's plane each reference is. A reference that the plane cuts is
// split into two. One workgroup per block of references. The references that are cut are few, and clipping is long, so
// the workgroup first lists them and then clips them side by side.
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

// Sides of a reference.
const uint BELOW = 1u;
const uint ABOVE = 2u;

// The sides of each reference of the block.
shared uint sides_of[KD_BLOCK_SIZE];
// The references of the block that their planes cut.
shared uint cut_references[KD_BLOCK_SIZE];

// The sides of a reference by its bounds alone. None if the cell becomes a leaf.
uint sides_by_bounds(KdReference reference, KdCell cell) {
    if (cell.axis == KD_NO_AXIS) return 0u;
    if (reference.box_max[cell.axis] <= cell.position) return BELOW;
    return reference.box_min[cell.axis] >= cell.position ? ABOVE : BELOW | ABOVE;
}

// Splits a reference that its plane cuts, and returns its sides.
uint split(uint reference_ix) {
    KdReference reference = references_from[reference_ix], piece_above;
    split_reference(triangles[reference.triangle_ix], cells_from[reference.cell_ix], reference, piece_above);
    bool is_below = !is_empty(reference), is_above = !is_empty(piece_above);
    // Only a reference with pieces on both sides is read from two places.
    references_from[reference_ix] = is_below ? reference : piece_above;
    if (is_below) above[reference_ix] = piece_above;
    return (is_below ? BELOW : 0u) | (is_above ? ABOVE : 0u);
}

// Returns the number of references that are cut.
uint list_cut_references(uint begin, uint n) {
    uint cut_rows = 0u;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint i = row * SCAN_GROUP_SIZE + scan_rank();
        if (i >= n) break;
        KdReference reference = references_from[begin + i];
        uint found = sides_by_bounds(reference, cells_from[reference.cell_ix]);
        sides_of[i] = found;
        if (found == (BELOW | ABOVE)) cut_rows |= 1u << row;
    }
    uint n_cut;
    uint place = workgroup_exclusive_add(bitCount(cut_rows), n_cut);
    for (; cut_rows != 0u; cut_rows &= cut_rows - 1u) {
        cut_references[place++] = findLSB(cut_rows) * SCAN_GROUP_SIZE + scan_rank();
    }
    return n_cut;
}

void main() {
    uint block = index_of_group();
    uint begin = min(block * KD_BLOCK_SIZE, levels[stage.level_ix].n_references);
    uint n = min(KD_BLOCK_SIZE, levels[stage.level_ix].n_references - begin);
    uint n_cut = list_cut_references(begin, n);
    barrier();
    for (uint i = scan_rank(); i < n_cut; i += SCAN_GROUP_SIZE) {
        sides_of[cut_references[i]] = split(begin + cut_references[i]);
    }
    barrier();
    uint sum = 0u;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint i = row * SCAN_GROUP_SIZE + scan_rank();
        uint found = i < n ? sides_of[i] : 0u;
        uvec2 counts = uvec2(found & BELOW, found >> 1u);
        uint total;
        uvec2 halves = halves_of(sum + workgroup_exclusive_add(counts.x | counts.y << 16, total));
        if (i < n) sides[begin + i] = halves.x | halves.y << 10 | found << 20;
        sum += total;
    }
    if (gl_LocalInvocationIndex == 0u && n > 0u) scan_blocks[block] = uvec4(halves_of(sum), 0u, 0u);
}
