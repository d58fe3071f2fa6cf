// Pending subtrees by the paper's bit mask: one bit a level, set where the sibling on that level is still to be
// visited (the paper stores the opposite, "sibling done"; 32 levels in one word).
//
// The paper climbs level by level and tests the sibling's box. Here the highest bit names the level at once, and what is
// pending stands in local memory in the bits' order (local_cells.glsl), without gaps: with a place for each level, rays that part
// soon spread over memory that the first cache cannot hold, and take up to a quarter longer (benches/EXPERIMENTS.md).

// 1 where no leaf lies deeper than KD_WORD_DEPTH, as in most trees: a mask of one word is 3 to 6 % faster. The same for all
// kernels over one tree.
layout(constant_id = CONSTANT_MASK_WORDS) const uint MASK_WORDS = 2u;

// Bit d - 1 of the words: depth d.
uvec2 pending_mask;

uvec2 bit_of(uint depth) {
    uint bit = 1u << ((depth - 1u) % KD_WORD_DEPTH);
    return MASK_WORDS == 1u || depth <= KD_WORD_DEPTH ? uvec2(bit, 0u) : uvec2(0u, bit);
}

// Depth of the highest bit; the mask is not empty.
uint deepest_pending() {
    if (MASK_WORDS == 2u && pending_mask.y != 0u) return KD_WORD_DEPTH + 1u + uint(findMSB(pending_mask.y));
    return 1u + uint(findMSB(pending_mask.x));
}

bool is_pending(uint depth) {
    return (pending_mask & bit_of(depth)) != uvec2(0u);
}

uint n_pending() {
    uint n = uint(bitCount(pending_mask.x));
    return MASK_WORDS == 1u ? n : n + uint(bitCount(pending_mask.y));
}

void mask_push(Cell cell) {
    keep_cell(n_pending(), cell);
    pending_mask |= bit_of(cell.depth);
}

void mask_pop(inout Cell cell) {
    cell.depth = deepest_pending();
    pending_mask &= ~bit_of(cell.depth);
    take_cell(n_pending(), cell);
}
