// Pending subtrees by the paper's bit mask: one bit a level, set where the sibling on that level is still to be
// visited (the paper stores the opposite, "sibling done"; 32 levels in one word. Two words hold KD_MAX_DEPTH).
//
// The paper climbs level by level and tests the sibling's box. Here the highest bit names the level at once, and the
// interval needs no box: a cell ends where the next pending one, higher up, begins, and that is one plane of an
// ancestor, found by parent links. Every level is climbed once.

// Bit d - 1 of the two words: depth d.
uvec2 pending_mask;
// The deepest pending node and where the ray enters it.
uint deepest_ix;
float t_deepest;

uvec2 bit_of(uint depth) {
    uint bit = 1u << ((depth - 1u) & 31u);
    return depth <= 32u ? uvec2(bit, 0u) : uvec2(0u, bit);
}

// Depth of the highest bit; the mask is not empty.
uint deepest_pending() {
    return uint(pending_mask.y != 0u ? 33 + findMSB(pending_mask.y) : 1 + findMSB(pending_mask.x));
}

bool is_pending(uint depth) {
    return (pending_mask & bit_of(depth)) != uvec2(0u);
}

void mask_push(uint second_ix, Cell cell, vec2 t_cross) {
    pending_mask |= bit_of(cell.depth);
    deepest_ix = second_ix;
    t_deepest = t_cross.x;
}

// Finds the pending node above `cell`, and with it where the cell ends; none: at the root cell's exit.
void climb(TraversalRay ray, inout Cell cell) {
    cell.t_exit = ray.t_exit;
    if (pending_mask == uvec2(0u)) return;
    uint path_ix = cell.node_ix;
    for (uint depth = deepest_pending(); depth < cell.depth; ++depth) path_ix = kd_parents[path_ix >> 1];
    deepest_ix = path_ix ^ 1u;
    vec2 t_cross = crossing(ray, kd_nodes[kd_parents[path_ix >> 1]]);
    t_deepest = t_cross.x;
    cell.t_exit = min(cell.t_exit, t_cross.y);
}

bool mask_pop(TraversalRay ray, float t_best, inout Cell cell) {
    while (pending_mask != uvec2(0u)) {
        if (t_best < t_deepest - ray.overlap) return false;
        cell.node_ix = deepest_ix;
        cell.depth = deepest_pending();
        cell.t_enter = max(t_deepest, ray.t_enter);
        pending_mask &= ~bit_of(cell.depth);
        climb(ray, cell);
        cell.t_exit = min(cell.t_exit, t_best);
        if (cell.t_enter <= t_best) return true;
    }
    return false;
}
