// Pending subtrees found again from the root (Foley, Sugerman: KD-Tree Acceleration Structures for a GPU Raytracer,
// Graphics Hardware 2005). No parent links, and nothing is kept but a bit a level.
//
// The paper keeps not even that: it enters the root again where the ray left the leaf. But cells that meet in one t have
// to be told apart, lest the old leaf be entered for ever. The bits are the trail of the way down (Laine: Restart Trail for Stackless BVH Traversal, HPG 2010), read as
// pending_mask.glsl writes them: at a set bit the way went to the first child; at one that is not set to the second,
// where the ray enters it at all. Each restart clears the lowest set bit and only sets lower ones: it ends.

// Levels from the root down to the cell's node.
uint trail_length;

// From the root to the lowest pending node, which is pending no more.
void retrace(TraversalRay ray, inout Cell cell) {
    trail_length -= mask_up();
    cell.node_offset = 0u;
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
