// Stores the state of a suspended search for a closest point, and resumes the search where it stopped. A part of
// closest_point.comp, which has the structs.
//
// The way from the root to the leaf says which cells are still to be visited: the far siblings of the near children
// on the way that may be closer than the best point. So only the leaf is stored.
//
// Needs search/suspended_rays.glsl, kd_nodes.glsl and distant_cells.glsl. Provides `suspend_at`, `resumed_best` and
// `resume`.

// Loads the best point so far.
Closest resumed_best() {
    SuspendedRay state = suspended_rays[resumed_slot];
    return Closest(state.t_best, state.triangle_ix, state.u, state.v);
}

// Stores the state, and returns the mark for the result.
uint suspend_at(LeafVisit leaf, Closest best) {
    return suspend(SuspendedRay(
        leaf.node_offset, 0.0, 0.0, leaf.entry_ix, leaf.end_ix, best.squared, best.triangle_ix, best.u, best.v,
        0u, uvec2(0u), outer.top_node, outer.top_pending, 0.0, 0u
    ));
}

// Walks from the root to a leaf, and makes pending what is still to be visited.
void walk_to(Query query, uint node_offset, float limit) {
    // Bit i, counted over both words: whether the node i levels above the leaf, on the way, is an upper child.
    uvec2 path = uvec2(0u);
    uint n_levels = 0u;
    for (uint at = node_offset; at != root_offset(); at = offset_of(kd_parent_of(node_ix_of(at)))) {
        path[n_levels / 32u] |= (node_ix_of(at) & 1u) << (n_levels % 32u);
        n_levels += 1u;
    }
    DistantCell cell = root_of(query);
    while (n_levels > 0u) {
        n_levels -= 1u;
        uint is_above = (path[n_levels / 32u] >> (n_levels % 32u)) & 1u;
        DistantCell near, far;
        split_cell(query, kd_node_at(node_ix_of(cell.node_offset)), cell, near, far);
        bool goes_near = (node_ix_of(near.node_offset) & 1u) == is_above;
        if (goes_near) push_if_closer(far, limit);
        if (goes_near) cell = near;
        else cell = far;
    }
}

// Loads the stored state of the search through a tree.
LeafVisit resume(Query query, float limit) {
    SuspendedRay state = suspended_rays[resumed_slot];
    resumes = false;
    walk_to(query, state.node_offset, limit);
    return LeafVisit(state.node_offset, state.entry_ix, state.end_ix);
}
