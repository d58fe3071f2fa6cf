// How many references are on either side of their cells' planes, before any reference of the level. A kernel that
// writes scan_blocks defines KD_SCAN_BLOCKS_ACCESS as the qualifier of that array.
#ifndef KDRAY_KD_SIDES
#define KDRAY_KD_SIDES

#include "kdtree_build/kd_build.glsl"

#ifndef KD_SCAN_BLOCKS_ACCESS
#define KD_SCAN_BLOCKS_ACCESS readonly
#endif

layout(std430, set = 0, binding = BIND_KD_SIDES) readonly buffer SidesBlock { uint sides[]; };
layout(std430, set = 0, binding = BIND_KD_SCAN_BLOCKS) KD_SCAN_BLOCKS_ACCESS buffer ScanBlocksBlock {
    uvec4 scan_blocks[];
};

// The numbers of references below and above, of all before a reference or of all of the level.
uvec2 sides_before(uint reference_ix) {
    KdLevel level = levels[stage.level_ix];
    if (reference_ix >= level.n_references) return uvec2(level.n_below, level.n_above);
    uint word = sides[reference_ix];
    return scan_blocks[reference_ix / KD_BLOCK_SIZE].xy + uvec2(word & 0x3ffu, (word >> 10) & 0x3ffu);
}

#endif
