// The triangles of a leaf. A ray is tested only against those whose planes it meets within the leaf. A part of
// kdtree/kdtree.glsl, and used by grid/grid.glsl, too.
//
// Needs scene.glsl, suspended_rays.glsl, steps.glsl and kdtree/slab.glsl. Provides `Visit`, `visit_leaf` and
// `find_candidate`.

// A ray's visit to a leaf: the entries of leaf_triangles that are still to be tested, from entry_ix up to, but not
// including, end_ix, and the ray's segment within the leaf.
struct Visit {
    uint entry_ix;
    uint end_ix;
    Interval interval;
};

// The visit to a leaf of the kd-tree, from t_enter to t_exit (the traversal's t).
Visit visit_leaf(KdNode leaf, float t_enter, float t_exit) {
    uint n_entries = leaf.axis_and_child >> KD_PAIR_SHIFT;
    count_steps(n_entries);
    return Visit(leaf.split_or_first, leaf.split_or_first + n_entries, interval_of(t_enter, t_exit));
}

// Finds the leaf's next triangle whose plane the ray meets within the leaf. Returns false if there is none, or if the
// invocation's loop iterations are spent. A triangle that is skipped can be hit only in another leaf, which has it,
// too. Most triangles are in several leaves, so this saves most tests.
bool find_candidate(TraversalRay ray, inout Visit visit, out uint entry_ix) {
    // If entry_ix were not set here, the compiler would keep its old value in a register from iteration to iteration.
    entry_ix = 0u;
    while (visit.entry_ix < visit.end_ix && has_iterations()) {
        count_iteration();
        entry_ix = visit.entry_ix;
        visit.entry_ix += 1u;
        if (!is_clear(ray, visit.interval, load_leaf_planes(entry_ix), extent().plane_epsilon)) return true;
    }
    return false;
}
