// Pending subtrees as the paper has them (Algorithm 2): nothing is noted on the way down. On the way up, a level at a
// time, a bit says that the sibling has been visited; where it has not, its box is tested.
//
// Corrected: 64 levels for 31; a failed test leaves the entry point alone; and a hit ends the search
// only where no other cell can hold a nearer one, not as soon as a leaf has any.

// As pending_mask.glsl has them, from the cell's node upward.
uvec2 siblings_done;

bool climb_by_boxes(TraversalRay ray, float t_best, inout Cell cell) {
    while (cell.node_offset != 0u) {
        count_turn();
        if ((siblings_done.x & 1u) == 0u) {
            vec2 interval = interval_in(ray, node_ix_of(sibling_of(cell.node_offset)));
            if (interval.x <= min(interval.y, t_best)) {
                siblings_done.x |= 1u;
                cell = Cell(sibling_of(cell.node_offset), interval.x, interval.y);
                return true;
            }
        }
        siblings_done = above(siblings_done, 1u);
        cell.node_offset = offset_of(kd_parent_of(node_ix_of(cell.node_offset)));
    }
    return false;
}
