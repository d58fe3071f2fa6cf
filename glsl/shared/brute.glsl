// Every triangle, without a tree, as the first ray tracing on GPUs did (Carr, Hall, Hart: The Ray Engine, Graphics
// Hardware 2002). For at most BRUTE_MAX_TRIANGLES.

void intersect_all(TraversalRay ray, bool any_hit, inout Nearest best) {
    for (uint triangle_ix = 0u; triangle_ix < frame.n_triangles && !is_done(any_hit, best); ++triangle_ix) {
        count_steps(1u);
        intersect(ray, triangle_at(triangle_ix), triangle_ix, best);
    }
}
