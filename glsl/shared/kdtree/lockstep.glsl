// The search for devices that run both sides of a branch for all lanes, as software drivers do (predication,
// PREDICATES_BRANCHES). A ray finds the same hits, in the same order, as by `search_in_one_loop`. A part of
// kdtree.glsl.
//
// On such devices, an `if` saves nothing: its body costs the same whether all lanes, some lanes or no lane take it. A
// loop ends as soon as no lane continues, but runs its body at least once. So loops test at their end whether to
// continue, which saves an iteration in which no lane takes part. They test at their beginning, too. Without that
// second test, lavapipe (Mesa 22.3) computes wrong results for lanes that leave the loop early: their variables get the
// values of the loop's last iteration.
//
// Needs everything that kdtree.glsl includes, and its `next_leaf`. Provides `search_in_step`.

// Does what `find_candidate` does. The candidate is the entry before the visit's entry_ix. reach:
// extent().plane_epsilon, which is passed in since loading it in each iteration takes lavapipe 23 instructions of 145.
bool find_candidate_in_step(TraversalRay ray, float reach, inout Visit visit) {
    bool found = false;
    bool looks = visit.entry_ix < visit.end_ix && has_iterations();
    while (looks) {
        count_iteration();
        found = !is_clear(ray, visit.interval, load_leaf_planes(visit.entry_ix), reach);
        visit.entry_ix += 1u;
        looks = !found && visit.entry_ix < visit.end_ix && has_iterations();
        if (!looks) break;
    }
    return found;
}

// Does what `intersect` does if `tests` is true, without a branch.
void intersect_in_step(TraversalRay ray, LeafTriangle entry, bool tests, inout Nearest best) {
    vec3 a, b, c;
    vec3 edges = seen_edges(ray.shear, corners_of(entry), a, b, c);
    vec3 errors = edge_errors(a, b, c);
    Hit hit = in_world(weighted_hit(
        ray.shear, exact_edges(edges, errors), vec3(a.z, b.z, c.z), entry.triangle_ix
    ));
    bool is_hit = tests && is_inside(with_exact_signs(edges, errors));
    bool is_new = is_hit && is_better(ray, hit.t, hit.triangle_ix, best);
    if (SKIPS_HIDDEN || has_alpha_test() || passes_back_faces()) {
        is_new = is_new && is_accepted(ray.shear, corners_of(entry), hit.triangle_ix, hit.u, hit.v);
    }
    vec2 weights = spilled_pair(WEIGHTS_SLOT);
    best.t = is_new ? hit.t : best.t;
    best.triangle_ix = is_new ? hit.triangle_ix : best.triangle_ix;
    spill_pair(WEIGHTS_SLOT, is_new ? hit.u : weights.x, is_new ? hit.v : weights.y);
}

// If the visit to this leaf is finished, goes on to the next leaf. Returns false if no leaf follows. begins: whether
// the ray has not yet come to its first leaf, which is then the next one.
bool go_on_in_step(TraversalRay ray, float t_best, inout bool begins, inout Cell cell, inout Visit visit) {
    bool goes_on = true;
    if (visit.entry_ix >= visit.end_ix) {
        if (!begins) goes_on = find_pending(ray, t_best, cell);
        if (goes_on) {
            if (!begins) take_pending(ray, cell);
            visit = next_leaf(ray, t_best, cell);
        }
        begins = false;
    }
    return goes_on;
}

// Searches in one loop. Each iteration seeks a triangle to test in at most two leaves: the second one only if the first
// one has none. Then it makes at most one test. If an iteration went on until all lanes have something to test, most
// lanes would wait. If it tested after every leaf, often no lane would have anything to test. Returns 0, or the mark of
// a ray that was suspended.
uint search_in_step(TraversalRay ray, bool any_hit, inout Nearest best) {
    Cell cell = root_cell(ray);
    // The ray starts at the root, with a visit that has nothing left to test.
    Visit visit = Visit(0u, 0u, interval_of(0.0, 0.0));
    float reach = extent().plane_epsilon;
    bool begins = true;
    bool goes_on = is_in(ray);
    uint mark = 0u;
    if (is_resumed()) {
        resume(ray, cell, visit, best);
        begins = false;
    }
    while (goes_on) {
        count_iteration();
        bool found = false;
        bool is_second = false;
        bool seeks = true;
        while (seeks) {
            goes_on = go_on_in_step(ray, best.t, begins, cell, visit);
            found = find_candidate_in_step(ray, reach, visit);
            seeks = goes_on && !found && !is_second;
            is_second = true;
            if (!seeks) break;
        }
        intersect_in_step(ray, leaf_triangle_at(found ? visit.entry_ix - 1u : 0u), found, best);
        goes_on = goes_on && !is_done(any_hit, best);
        if (goes_on && !has_iterations()) {
            mark = suspend_at(cell, visit, best);
            goes_on = false;
        }
        if (!goes_on) break;
    }
    return mark;
}
