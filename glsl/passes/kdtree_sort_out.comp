#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, sort out: finds on which sides of its cell's plane each reference is. A reference that the plane cuts is
// split into two. One workgroup per block of references. The references that are cut are few, and clipping is long, so
// the workgroup first lists them and then clips them side by side. The last workgroup finds how many references come
// below and above planes before each block.
// Reads build, triangles, cells_from; updates levels, references_from, scan_blocks; writes above, sides.
#include "kdtree_build/kd_clip.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_TRIANGLES) readonly buffer TrianglesBlock { Triangle triangles[]; };
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) readonly buffer CellsFromBlock { KdCell cells_from[]; };
layout(std430, set = 0, binding = BIND_KD_REFERENCES_FROM) buffer ReferencesFromBlock {
    KdReference references_from[];
};
layout(std430, set = 0, binding = BIND_KD_ABOVE) writeonly buffer AboveBlock { KdReference above[]; };
layout(std430, set = 0, binding = BIND_KD_SIDES) writeonly buffer SidesBlock { uint sides[]; };
layout(std430, set = 0, binding = BIND_KD_SCAN_BLOCKS) coherent buffer ScanBlocksBlock { uvec4 scan_blocks[]; };

#include "kdtree_build/kd_spine.glsl"

// Sides of a reference.
const uint BELOW = 1u;
const uint ABOVE = 2u;

// The sides of each reference of the block.
shared uint sides_of[KD_BLOCK_SIZE];
// The references of the block that their planes cut.
shared uint cut_references[KD_BLOCK_SIZE];
// How many references of each row are below and above, as two halves, by subgroups.
shared uint in_subgroups[KD_ROWS][SCAN_GROUP_SIZE / 4u];

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

// Finds the sides of n references by their bounds alone, none for those of leaves. Returns the number of references
// that are cut. All loads of a kind come before the first use, so that none waits for another.
uint list_cut_references(uint begin, uint n) {
    uint cells[KD_ROWS];
    uint axes[KD_ROWS];
    float positions[KD_ROWS];
    vec2 bounds[KD_ROWS];
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint i = min(row * SCAN_GROUP_SIZE + scan_rank(), n - 1u);
        cells[row] = references_from[begin + i].cell_ix;
    }
    for (uint row = 0u; row < KD_ROWS; ++row) {
        axes[row] = cells_from[cells[row]].axis;
        positions[row] = cells_from[cells[row]].position;
    }
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint i = begin + min(row * SCAN_GROUP_SIZE + scan_rank(), n - 1u), axis = min(axes[row], 2u);
        bounds[row] = vec2(references_from[i].box_min[axis], references_from[i].box_max[axis]);
    }
    uint cut_rows = 0u;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint i = row * SCAN_GROUP_SIZE + scan_rank();
        uint found = BELOW | ABOVE;
        if (axes[row] == KD_NO_AXIS || i >= n) found = 0u;
        else if (bounds[row].y <= positions[row]) found = BELOW;
        else if (bounds[row].x >= positions[row]) found = ABOVE;
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

// Writes the sides of n references, and how many of the block come before each of them. Returns all, as two halves.
uint write_sides(uint begin, uint n) {
    uint found[KD_ROWS];
    uint before[KD_ROWS];
    for (uint row = 0u; row < KD_ROWS; ++row) {
        found[row] = sides_of[row * SCAN_GROUP_SIZE + scan_rank()];
        uint counts = (found[row] & BELOW) | (found[row] >> 1u) << 16;
        before[row] = subgroupExclusiveAdd(counts);
        if (gl_SubgroupInvocationID == gl_SubgroupSize - 1u) in_subgroups[row][gl_SubgroupID] = before[row] + counts;
    }
    barrier();
    uint sum = 0u;
    for (uint row = 0u; row < KD_ROWS; ++row) {
        for (uint i = 0u; i < gl_NumSubgroups; ++i) {
            if (i == gl_SubgroupID) before[row] += sum;
            sum += in_subgroups[row][i];
        }
        uint i = row * SCAN_GROUP_SIZE + scan_rank();
        uvec2 halves = halves_of(before[row]);
        if (i < n) sides[begin + i] = halves.x | halves.y << 10 | found[row] << 20;
    }
    return sum;
}

void scan_blocks_of_level(uint n_blocks) {
    uvec2 part = own_part(n_blocks);
    uvec3 total, before = sum_before_part(0u, part, total);
    write_prefix_sums(0u, part, before);
    if (gl_LocalInvocationIndex != 0u) return;
    levels[stage.level_ix].n_below = total.x;
    levels[stage.level_ix].n_above = total.y;
}

void main() {
    uint block = index_of_group();
    uint begin = block * KD_BLOCK_SIZE, end = levels[stage.level_ix].n_references;
    // The condition is the same for all invocations of the workgroup.
    if (begin >= end) return;
    uint n = min(KD_BLOCK_SIZE, end - begin);
    uint n_cut = list_cut_references(begin, n);
    barrier();
    for (uint i = scan_rank(); i < n_cut; i += SCAN_GROUP_SIZE) {
        sides_of[cut_references[i]] = split(begin + cut_references[i]);
    }
    barrier();
    uint sum = write_sides(begin, n);
    if (gl_LocalInvocationIndex == 0u) {
        scan_blocks[block] = uvec4(halves_of(sum), 0u, 0u);
        memoryBarrierBuffer();
        is_last_group = atomicAdd(levels[stage.level_ix].n_summed_blocks, 1u) == blocks_of(end) - 1u;
        memoryBarrierBuffer();
    }
    barrier();
    if (is_last_group) scan_blocks_of_level(blocks_of(end));
}
