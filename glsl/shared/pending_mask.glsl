// Pending subtrees by the paper's bit mask: one bit a level, set where the sibling on that level is still to be
// visited (the paper stores the opposite, "sibling done"; 32 levels in one word).
//
// The paper counts levels from the root, and climbs one after the other to test the sibling's box. Here the mask is shifted
// as the ray goes down: the lowest bit is the level of the cell's node, so that no depth is kept, and the lowest bit that is set
// tells at once how far to go up. What is pending stands in local memory in the bits' order (local_cells.glsl), without gaps: with
// a place for each level, rays that part soon spread over memory that the first cache cannot hold, and take up to a quarter
// longer (benches/EXPERIMENTS.md).

// 1 where no leaf lies deeper than KD_WORD_DEPTH, as in most trees: a mask of one word is shifted and searched faster. The same
// for all kernels over one tree.
layout(constant_id = CONSTANT_MASK_WORDS) const uint MASK_WORDS = 2u;

// Bit i, of the words together: the sibling i levels above the cell's node.
uvec2 pending_mask;

// A mask as it is one level farther down.
uvec2 below(uvec2 mask) {
    return uvec2(mask.x << 1, MASK_WORDS == 1u ? 0u : (mask.y << 1) | (mask.x >> (KD_WORD_DEPTH - 1u)));
}

// And n levels farther up, fewer than a word's.
uvec2 above(uvec2 mask, uint n) {
    if (MASK_WORDS == 1u) return uvec2(mask.x >> n, 0u);
    return uvec2((mask.x >> n) | ((mask.y << 1) << (KD_WORD_DEPTH - 1u - n)), mask.y >> n);
}

bool is_pending(uint n_levels_up) {
    bool is_high = MASK_WORDS == 2u && n_levels_up >= KD_WORD_DEPTH;
    uint word = is_high ? pending_mask.y : pending_mask.x;
    return ((word >> (n_levels_up % KD_WORD_DEPTH)) & 1u) != 0u;
}

uint n_pending() {
    uint n = uint(bitCount(pending_mask.x));
    return MASK_WORDS == 1u ? n : n + uint(bitCount(pending_mask.y));
}

void mask_down() {
    pending_mask = below(pending_mask);
}

// The sibling of the cell's node is pending.
void mark() {
    pending_mask.x |= 1u;
}

// Up to the lowest sibling that is pending, and is no more. By how many levels. The mask is not empty.
uint mask_up() {
    bool is_high = MASK_WORDS == 2u && pending_mask.x == 0u;
    if (is_high) pending_mask = uvec2(pending_mask.y, 0u);
    uint n = uint(findLSB(pending_mask.x));
    pending_mask = above(pending_mask, n);
    pending_mask.x ^= 1u;
    return is_high ? KD_WORD_DEPTH + n : n;
}

// Where the last of what is pending is kept.
uint last_place() {
    return n_pending() - 1u;
}

// A cell's place is asked for where the mask has its bit: NVIDIA's compiler takes 48 registers, not 40, where it has not.
void mask_push(Cell cell) {
    mark();
    keep_cell(last_place(), cell);
}

void mask_pop(inout Cell cell) {
    take_cell(last_place(), cell);
    mask_up();
}
