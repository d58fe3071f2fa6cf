// Pending subtrees by restarts: each is found from the root (Foley, Sugerman: KD-Tree Acceleration Structures for a
// GPU Raytracer, Graphics Hardware 2005). There are no parent links, and only one bit for each level is kept. A part
// of pending.glsl.
//
// The paper does not keep these bits: it enters the root again at the t where the ray left the leaf. This t alone
// does not suffice, since the leaf that the ray has left also contains it, and could be entered again without end.
// The bits are the trail of the path down (Laine: Restart Trail for Stackless BVH Traversal, HPG 2010). They are kept
// in `pending_mask`. At a set bit, the path went to the first child. At a cleared bit, it went to the second child if
// the ray enters that child at all. Each restart clears the lowest set bit and sets only lower ones, so the traversal
// ends.
//
// Needs kd_nodes.glsl and pending_mask.glsl. Provides `trail_length` and `retrace`.

// Levels from the root to the cell's node.
uint trail_length;

// Walks from the root to the lowest pending node, whose bit it clears.
void retrace(TraversalRay ray, inout Cell cell) {
    trail_length -= mask_up();
    cell.node_offset = root_offset();
    cell.t_exit = ray.t_exit;
    for (uint n_left = trail_length; n_left > 0u; --n_left) {
        KdNode node = kd_node(cell.node_offset);
        float t_cross = crossing(ray, node);
        bool to_first = is_pending(n_left - 1u);
        bool in_second = t_cross <= cell.t_exit;
        cell.node_offset = child_of(ray, node, in_second && !to_first);
        if (to_first) cell.t_exit = min(cell.t_exit, t_cross);
    }
}
