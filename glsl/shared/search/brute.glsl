// Brute force: tests every triangle without a tree, as the first ray tracing on GPUs did (Carr, Hall, Hart: The Ray
// Engine, Graphics Hardware 2002). A scene may have at most BRUTE_MAX_TRIANGLES. A part of kdtree/kdtree.glsl.
//
// Needs scene.glsl, suspended_rays.glsl, steps.glsl, candidate.glsl, kdtree/kd_nodes.glsl, leaf.glsl and
// kdtree/resume.glsl. Provides `intersect_all`.

// Tests all triangles. Returns 0, or the mark of a ray that was suspended.
uint intersect_all(TraversalRay ray, bool any_hit, inout Nearest best) {
    Cell cell = root_cell(ray);
    Visit all = Visit(extent().first_row, extent().first_row + extent().n_triangles, interval_of(0.0, 0.0));
    if (is_resumed()) resume(ray, cell, all, best);
    while (all.entry_ix < all.end_ix && !is_done(any_hit, best) && has_iterations()) {
        count_iteration();
        count_steps(1u);
        intersect(ray, stored_triangle_at(all.entry_ix), all.entry_ix, best);
        all.entry_ix += 1u;
    }
    bool ends = all.entry_ix >= all.end_ix || is_done(any_hit, best);
    return ends ? 0u : suspend_at(cell, all, best);
}
