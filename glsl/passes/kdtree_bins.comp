#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, bins: counts the references of large cells by bins. One workgroup per KD_BIN_BLOCK references. These belong
// to two large cells at most: such a cell has more references, so it has the first or the last one of the workgroup.
// Atomics combine the workgroups' bins; sums and maxima of integers are the same in every order.
// Reads build, levels, cells_from, references_from; updates large_bins.
#include "kdtree_build/kd_bins.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) readonly buffer CellsFromBlock { KdCell cells_from[]; };
layout(std430, set = 0, binding = BIND_KD_REFERENCES_FROM) readonly buffer ReferencesFromBlock {
    KdReference references_from[];
};
layout(std430, set = 0, binding = BIND_KD_BINS) buffer BinsBlock { uint large_bins[]; };

// Adds the bins of the workgroup's references to those of a large cell.
void combine(KdCell cell) {
    uint first_word = cell.first / KD_BIN_BLOCK * KD_BIN_WORDS;
    for (uint i = gl_LocalInvocationIndex; i < KD_BIN_WORDS; i += SCAN_GROUP_SIZE) {
        if (bins[i] == 0u) continue;
        if ((i / KD_BINS) % 4u <= BIN_ENDS) atomicAdd(large_bins[first_word + i], bins[i]);
        else atomicMax(large_bins[first_word + i], bins[i]);
    }
}

void count(KdCell cell, uint begin, uint end) {
    Areas areas[3] = Areas[3](areas_of(cell, 0u), areas_of(cell, 1u), areas_of(cell, 2u));
    for (uint i = begin + gl_LocalInvocationIndex; i < end; i += SCAN_GROUP_SIZE) {
        count_in_bins(areas, references_from[i].box_min, references_from[i].box_max);
    }
}

void main() {
    uint n = levels[stage.level_ix].n_references;
    uint begin = min(index_of_group() * KD_BIN_BLOCK, n), end = min(begin + KD_BIN_BLOCK, n);
    uint first_ix = begin < end ? references_from[begin].cell_ix : 0u;
    uint last_ix = begin < end ? references_from[end - 1u].cell_ix : 0u;
    for (uint i = 0u; i < (first_ix == last_ix ? 1u : 2u); ++i) {
        KdCell cell = cells_from[i == 0u ? first_ix : last_ix];
        bool is_large = begin < end && cell.n_references > KD_BIN_BLOCK && may_split(cell.n_references);
        clear_bins();
        barrier();
        if (is_large) count(cell, max(begin, cell.first), min(end, cell.first + cell.n_references));
        barrier();
        if (is_large) combine(cell);
        barrier();
    }
}
