// The triangles of a leaf, of which a ray is tested only against those whose planes it meets there. A part of kdtree.glsl.

// A ray's way through a leaf, with the entries that are still to be looked at.
struct Visit {
    uint entry_ix;
    uint end_ix;
    Segment way;
};

Visit visit_leaf(KdNode leaf, float t_enter, float t_exit) {
    uint n_entries = leaf.axis_and_child >> KD_PAIR_SHIFT;
    count_steps(n_entries);
    return Visit(leaf.split_or_first, leaf.split_or_first + n_entries, segment_of(t_enter, t_exit));
}

// On to the leaf's next triangle whose plane the ray meets on its way. It may meet the others' planes elsewhere, in leaves
// that have those triangles too: most are in several, so most tests are spared.
bool find_candidate(TraversalRay ray, inout Visit visit, out uint entry_ix) {
    // What is left undefined is kept from turn to turn, in a register.
    entry_ix = 0u;
    while (visit.entry_ix < visit.end_ix && has_turns()) {
        count_turn();
        entry_ix = visit.entry_ix;
        visit.entry_ix += 1u;
        if (!is_clear(ray, visit.way, load_leaf_planes(entry_ix), accel.plane_epsilon)) return true;
    }
    return false;
}
