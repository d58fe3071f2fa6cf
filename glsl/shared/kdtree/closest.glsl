// The search of a kd-tree for the closest point. A part of closest_point.comp.
//
// Needs scene.glsl, search/suspended_rays.glsl, search/point_triangle.glsl, kd_nodes.glsl, distant_cells.glsl,
// instances/closest.glsl and SKIPS_HIDDEN. Provides `LeafVisit`, `Closest`, `search_tree`, and `suspend_at` and
// `resumed_best` of resume_closest.glsl.

// A leaf and those of its entries that are still to be tested.
struct LeafVisit {
    uint node_offset;
    uint entry_ix;
    uint end_ix;
};

// The closest point so far: the square of its distance, its triangle and its weights.
struct Closest {
    float squared;
    uint triangle_ix;
    float u;
    float v;
};

// Descends to the leaf of a cell that is closest to the point.
LeafVisit descend(Query query, float limit, DistantCell cell) {
    KdNode node = kd_node(cell.node_offset);
    while (!is_leaf(node)) {
        DistantCell near, far;
        split_cell(query, node, cell, near, far);
        push_if_closer(far, limit);
        cell = near;
        node = kd_node(cell.node_offset);
    }
    uint n_entries = node.axis_and_child >> KD_PAIR_SHIFT;
    return LeafVisit(cell.node_offset, node.split_or_first, node.split_or_first + n_entries);
}

// The triangle of a leaf's entry, in the world.
LeafTriangle world_triangle_at(uint entry_ix) {
    LeafTriangle entry = leaf_triangle_at(entry_ix);
    if (INSTANCED) {
        entry.triangle_ix -= placed.to_row;
        vec3 corners[3] = vec3[3](entry.v0, entry.v1, entry.v2);
        for (uint i = 0u; i < 3u; ++i) corners[i] = placed_corner(corners[i], FLAT_NORMAL).xyz;
        entry.v0 = corners[0];
        entry.v1 = corners[stored_corner(1u)];
        entry.v2 = corners[stored_corner(2u)];
    }
    return entry;
}

// Tests a triangle of a leaf. Of two that are equally close, the one of the lower index counts.
void test_entry(Query query, uint entry_ix, inout Closest best) {
    LeafTriangle entry = world_triangle_at(entry_ix);
    if (SKIPS_HIDDEN && (load_triangle_materials(entry.triangle_ix) & TRIANGLE_HIDDEN) != 0u) return;
    precise vec3 a = entry.v0 * query.scale - query.position;
    precise vec3 b = entry.v1 * query.scale - query.position;
    precise vec3 c = entry.v2 * query.scale - query.position;
    PointOnTriangle at = closest_on_triangle(a, b, c);
    bool is_first = at.squared == best.squared && entry.triangle_ix < best.triangle_ix;
    if (at.squared < best.squared || is_first) best = Closest(at.squared, entry.triangle_ix, at.u, at.v);
}

#include "kdtree/resume_closest.glsl"

// The square of the distance beyond which cells of the tree have no point as close as the best one.
float limit_in_tree(LocalQuery at, Closest best) {
    if (INSTANCED) return limit_of(at, best.squared);
    return best.squared;
}

// Searches a tree. at: the point in its space. Returns 0, or the mark of a search that was suspended.
uint search_tree(Query query, LocalQuery at, inout Closest best) {
    LeafVisit leaf = LeafVisit(root_offset(), 0u, 0u); // nothing to test before the first descent
    if (is_resumed()) leaf = resume(at.query, limit_in_tree(at, best));
    else push_if_closer(root_of(at.query), limit_in_tree(at, best));
    uint mark = 0u;
    bool goes_on = true;
    while (goes_on) {
        count_iteration();
        if (leaf.entry_ix < leaf.end_ix) {
            test_entry(query, leaf.entry_ix, best);
            leaf.entry_ix += 1u;
        } else if (n_pending > 0u) {
            DistantCell cell = pop_pending();
            float limit = limit_in_tree(at, best);
            if (may_be_closer(cell.gap, limit)) leaf = descend(at.query, limit, cell);
        } else {
            goes_on = false;
        }
        if (goes_on && !has_iterations()) {
            mark = suspend_at(leaf, best);
            goes_on = false;
        }
    }
    return mark;
}
