// Candidates: triangles that a search comes to, against the nearest hit so far. A part of accel.glsl.

// Whether rays pass through some of the triangles.
layout(constant_id = CONSTANT_FILTERS) const bool FILTERS = false;

// The nearest hit so far; where it lies in its triangle is in local memory.
struct Nearest {
    float t;
    uint triangle_ix;
};

// Whether a hit is the ray's, and nearer than the best; of two hits at one t the lower index wins, whatever the order of triangles.
bool is_better(TraversalRay ray, float t, uint triangle_ix, Nearest best) {
    bool nearer = t < best.t || (t == best.t && triangle_ix < best.triangle_ix);
    return t > ray.t_min && nearer && triangle_ix != ray.source_triangle;
}

// Whether a hit counts. Without FILTERS each does, and nothing is read. u, v: barycentric weights of the hit.
bool is_accepted(uint triangle_ix, float u, float v) {
    if (FILTERS) return (load_triangle_materials(triangle_ix) & TRIANGLE_HIDDEN) == 0u;
    return true;
}

// A triangle against the ray.
void intersect(TraversalRay ray, Triangle triangle, uint triangle_ix, inout Nearest best) {
    Hit hit;
    if (!intersect_triangle(ray.shear, triangle, triangle_ix, hit)) return;
    if (is_better(ray, hit.t, triangle_ix, best) && is_accepted(triangle_ix, hit.u, hit.v)) {
        best = Nearest(hit.t, triangle_ix);
        spill_pair(WEIGHTS_SLOT, hit.u, hit.v);
    }
}

bool is_done(bool any_hit, Nearest best) {
    return any_hit && best.triangle_ix != NO_TRIANGLE;
}
