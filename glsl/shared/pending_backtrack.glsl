// Pending subtrees without any memory: back to the deepest ancestor whose box the ray has not left, and down from there
// (Foley, Sugerman: KD-Tree Acceleration Structures for a GPU Raytracer, Graphics Hardware 2005, "kd-backtrack").
//
// The paper compares the ancestor's exit with the leaf's: where cells end at the same t, that could lead back into the
// leaf. But the ray comes to an ancestor from its first child or from its second, and the
// direction alone says which is which: from the second the ancestor is done; from the first, it is left unless its
// split plane lies before its exit.

bool backtrack(TraversalRay ray, float t_best, inout Cell cell) {
    while (cell.node_offset != 0u) {
        uint parent_ix = kd_parent_of(node_ix_of(cell.node_offset));
        KdNode parent = kd_node(offset_of(parent_ix));
        if (cell.node_offset == first_child(ray, parent)) {
            float t_enter = crossing(ray, parent);
            float t_exit = interval_in(ray, parent_ix).y;
            if (t_enter <= min(t_exit, t_best)) {
                cell = Cell(sibling_of(cell.node_offset), max(t_enter, ray.t_enter), t_exit);
                return true;
            }
        }
        cell.node_offset = offset_of(parent_ix);
    }
    return false;
}
