// Pending subtrees as in the paper's Algorithm 2. Nothing is stored on the way down. On the way up, which goes level
// by level, a bit tells whether the sibling has been visited. If it has not, its box is tested. A part of
// pending.glsl.
//
// This version corrects the paper in three points. There are 64 levels instead of 31. If the test of a box fails, the
// t at which the ray enters stays as it is. A hit ends the search only if no other cell can hold a nearer one, not as
// soon as any leaf has a hit.
//
// Needs kd_nodes.glsl, kd_boxes.glsl and pending_mask.glsl. Provides `climb_by_boxes` and `siblings_done`.

// Bit i, counted over both words: whether the sibling of the node i levels above the cell's node has been visited.
// The word is shifted as `pending_mask` is.
uvec2 siblings_done;

// Finds the next pending cell upwards from the cell's node. Returns false if there is none that may hold a hit nearer
// than t_best.
bool climb_by_boxes(TraversalRay ray, float t_best, inout Cell cell) {
    while (cell.node_offset != root_offset()) {
        count_iteration();
        if ((siblings_done.x & 1u) == 0u) {
            vec2 interval = interval_in(ray, node_ix_of(sibling_of(cell.node_offset)));
            if (interval.x <= min(interval.y, t_best)) {
                siblings_done.x |= 1u;
                cell = Cell(sibling_of(cell.node_offset), interval.x, interval.y);
                return true;
            }
        }
        siblings_done = mask_shifted_up(siblings_done, 1u);
        cell.node_offset = offset_of(kd_parent_of(node_ix_of(cell.node_offset)));
    }
    return false;
}
