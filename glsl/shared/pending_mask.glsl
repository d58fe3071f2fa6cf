// Pending subtrees by the paper's bit mask: one bit a level, set where the sibling on that level is still to be
// visited (the paper stores the opposite, "sibling done"; 32 levels in one word).
//
// The paper climbs level by level and tests the sibling's box. Here the highest bit names the level at once, and no box
// is needed: a cell begins where the ray has just left the one before it, and ends where the next pending one, higher up,
// begins, which is one plane of an ancestor.

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

// The node on the way from the root to node_ix, so many levels higher.
uint ancestor_of(uint node_ix, uint n_levels) {
    for (uint level = 0u; level < n_levels; ++level) node_ix = kd_parent_of(node_ix);
    return node_ix;
}

// By parent links to the deepest pending node, which is pending no more, and on to the plane where its cell ends: that of
// the next one, or the root cell's exit.
void climb(TraversalRay ray, inout Cell cell) {
    uint depth = deepest_pending();
    uint path_ix = ancestor_of(cell.node_ix, cell.depth - depth);
    pending_mask &= ~bit_of(depth);
    cell = Cell(path_ix ^ 1u, depth, cell.t_enter, ray.t_exit);
    if (pending_mask == uvec2(0u)) return;
    uint next_ix = ancestor_of(path_ix, depth - deepest_pending());
    cell.t_exit = crossing(ray, kd_node(kd_parent_of(next_ix)));
}
