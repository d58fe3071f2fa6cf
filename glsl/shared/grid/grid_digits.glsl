// Digits of the cells' indices, by which pairs are sorted: GRID_DIGIT_BITS bits from sort.first_bit on. Needs
// GL_KHR_shader_subgroup_ballot; provides the push constants `sort`.
#ifndef KDRAY_GRID_DIGITS
#define KDRAY_GRID_DIGITS

#include "layout.glsl"

layout(push_constant) uniform SortBlock { GridSort sort; };

uint digit_of(uint cell_ix) {
    return cell_ix >> sort.first_bit & GRID_DIGITS - 1u;
}

// The peers of an invocation: a ballot of the invocations of the subgroup that have a pair with the same digit.
uvec4 peers_of(uint digit, bool has_pair) {
    uvec4 peers = subgroupBallot(has_pair);
    for (uint bit = 0u; bit < GRID_DIGIT_BITS; ++bit) {
        bool is_set = (digit >> bit & 1u) != 0u;
        uvec4 others = subgroupBallot(is_set);
        peers &= is_set ? others : ~others;
    }
    return peers;
}

#endif
