// Pending subtrees by the paper's bit mask. It has one bit for each level, which is set if the sibling on that level
// is still to be visited. (The paper stores the opposite, "sibling done", in one word of 32 bits.) A part of
// pending.glsl.
//
// The paper counts levels from the root, and climbs them one by one to test the sibling's box. Here the mask is
// shifted as the ray goes down. So the lowest bit is the level of the cell's node, no depth has to be kept, and the
// lowest set bit tells directly how many levels to go up. The pending cells are in local memory in the order of the
// bits, without gaps (local_cells.glsl). With a slot for each level, divergent rays would soon spread over more
// memory than the first cache holds, and would take up to a quarter longer (docs/experiments.md).
//
// Needs kd_nodes.glsl and local_cells.glsl. Provides `mask_down`, `mask_push` and `mask_pop`. Other methods also use
// the mask itself: `mask_shifted_down`, `mask_shifted_up`, `is_pending`, `mask_mark` and `mask_up`.

// Words of the mask: 1 if no leaf is deeper than KD_WORD_DEPTH, which is so in most trees, otherwise 2. One word
// takes less time to shift and to search than two. The value is the same for all kernels over one tree.
layout(constant_id = CONSTANT_MASK_WORDS) const uint MASK_WORDS = 2u;

// Bit i, counted over both words: whether the sibling of the node i levels above the cell's node is pending. Bit 0 is
// the sibling of the cell's node itself.
uvec2 pending_mask;

// The mask as seen from one level farther down.
uvec2 mask_shifted_down(uvec2 mask) {
    return uvec2(mask.x << 1, MASK_WORDS == 1u ? 0u : (mask.y << 1) | (mask.x >> (KD_WORD_DEPTH - 1u)));
}

// The mask as seen from n levels farther up, n < KD_WORD_DEPTH.
uvec2 mask_shifted_up(uvec2 mask, uint n) {
    if (MASK_WORDS == 1u) return uvec2(mask.x >> n, 0u);
    return uvec2((mask.x >> n) | ((mask.y << 1) << (KD_WORD_DEPTH - 1u - n)), mask.y >> n);
}

// Whether the sibling of the node n_levels_up above the cell's node is pending.
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
    pending_mask = mask_shifted_down(pending_mask);
}

// Marks the sibling of the cell's node as pending.
void mask_mark() {
    pending_mask.x |= 1u;
}

// Goes up to the lowest pending sibling and clears its bit. Returns the number of levels. The mask must not be empty.
uint mask_up() {
    bool is_high = MASK_WORDS == 2u && pending_mask.x == 0u;
    if (is_high) pending_mask = uvec2(pending_mask.y, 0u);
    uint n = uint(findLSB(pending_mask.x));
    pending_mask = mask_shifted_up(pending_mask, n);
    pending_mask.x ^= 1u;
    return is_high ? KD_WORD_DEPTH + n : n;
}

// Slot in local memory of the deepest pending cell, which is the next to be visited.
uint last_slot() {
    return n_pending() - 1u;
}

// `mask_push` and `mask_pop` both compute a cell's slot while the cell's bit is set in the mask. Otherwise NVIDIA's
// compiler uses 48 registers instead of 40.
void mask_push(Cell cell) {
    mask_mark();
    keep_cell(last_slot(), cell);
}

void mask_pop(inout Cell cell) {
    take_cell(last_slot(), cell);
    mask_up();
}
