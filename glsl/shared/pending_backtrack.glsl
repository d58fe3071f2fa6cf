// Pending subtrees without any memory: back to the deepest ancestor whose box the ray has not left, and down from there
// (Foley, Sugerman: KD-Tree Acceleration Structures for a GPU Raytracer, Graphics Hardware 2005, "kd-backtrack").
//
// The paper compares the ancestor's exit with the leaf's: where cells end at the same t, that could lead back into the
// leaf. But the ray comes to an ancestor from its first child or from its second, and the
// direction alone says which is which: from the second the ancestor is done; from the first, it is left unless its
// split plane lies before its exit.

bool backtrack_pop(TraversalRay ray, float t_best, inout Cell cell) {
    // What has not been visited begins where the leaf ends, or later.
    if (t_best < cell.t_exit) return false;
    while (cell.node_ix != 0u) {
        uint parent_ix = kd_parent_of(cell.node_ix);
        KdNode parent = kd_node(parent_ix);
        if (cell.node_ix == first_child(ray, parent)) {
            float t_enter = crossing(ray, parent);
            float t_exit = interval_in(ray, parent_ix).y;
            if (t_enter <= min(t_exit, t_best)) {
                cell = Cell(cell.node_ix ^ 1u, cell.depth, max(t_enter, ray.t_enter), t_exit);
                return true;
            }
        }
        cell.node_ix = parent_ix;
    }
    return false;
}
