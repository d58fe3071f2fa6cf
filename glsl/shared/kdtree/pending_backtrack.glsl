// Pending subtrees without any memory: the ray goes back to the deepest ancestor whose box it has not left, and down
// from there (Foley, Sugerman: KD-Tree Acceleration Structures for a GPU Raytracer, Graphics Hardware 2005,
// "kd-backtrack"). A part of pending.glsl.
//
// The paper compares the ancestor's exit with the leaf's. If cells end at the same t, that could lead back into the
// leaf. This version asks instead from which child the ray comes back to an ancestor. The ray's direction alone tells
// whether that is the ancestor's first or second child. After the second child, the ancestor is done. After the first
// child, the second one is pending if the ray crosses the split plane before it leaves the ancestor.
//
// Needs kd_nodes.glsl and kd_boxes.glsl. Provides `backtrack`.

// Finds the next pending cell upwards from the cell's node. Returns false if there is none that may hold a hit nearer
// than t_best.
bool backtrack(TraversalRay ray, float t_best, inout Cell cell) {
    while (cell.node_offset != root_offset()) {
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
