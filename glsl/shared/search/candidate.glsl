// Candidates, which are the triangles that a search comes to, and their test against the nearest hit so far. A part
// of accel.glsl.
//
// Needs scene.glsl, triangle.glsl, traversal_ray.glsl, local_memory.glsl, TESTS_BLENDED, whether the rays are shadow
// rays, which test blended materials, and FROM_CAMERA, whether they are camera rays, which pass through back faces.
// Provides `Nearest`, `intersect`, `is_better`, `has_alpha_test`, `passes_back_faces`, `is_accepted`, `is_done`.

#include "shading/alpha_test.glsl"
#include "shading/back_faces.glsl"

// Whether rays pass through triangles that are marked TRIANGLE_HIDDEN in `triangle_materials`.
layout(constant_id = CONSTANT_SKIPS_HIDDEN) const bool SKIPS_HIDDEN = false;

// The nearest hit so far, with the traversal's t. Its barycentric weights are in local memory (WEIGHTS_SLOT).
struct Nearest {
    float t;
    uint triangle_ix;
};

#ifdef NEXT_HITS
// The hit that the search goes on from, or NO_TRIANGLE: only hits behind it count, in the order of t and then of the
// triangles' indices. Its t is that of the ray in traversal_ray.glsl, in the space of an instance if there are
// instances, but not halved (all_hits.comp).
Nearest last_hit = Nearest(0.0, NO_TRIANGLE);
#endif

// Whether a hit is in the ray's interval, not on its source triangle, and nearer than the best one. Of two hits at
// the same t, the one with the lower triangle index wins, so the order of tests does not matter. The first `best` is
// at the ray's t_max with NO_TRIANGLE, the highest index, so a hit at t_max counts.
bool is_better(TraversalRay ray, float t, uint triangle_ix, Nearest best) {
    bool nearer = t < best.t || (t == best.t && triangle_ix < best.triangle_ix);
#ifdef NEXT_HITS
    // With a last hit, its t is the ray's t_min.
    if (t == ray.t_min && triangle_ix > last_hit.triangle_ix) return nearer;
#endif
    return t > ray.t_min && nearer && triangle_ix != ray.source_triangle;
}

// Whether the rays pass through parts of triangles. Only modules that are compiled with WITH_ALPHA_TEST have the code
// for it (build.rs).
bool has_alpha_test() {
#ifdef WITH_ALPHA_TEST
    if (TESTS_BLENDED) return SHADOW_ALPHA_TEST;
    return ALPHA_MASKS;
#else
    return false;
#endif
}

// Whether the rays pass through back faces. The same modules have the code for it.
bool passes_back_faces() {
#ifdef WITH_ALPHA_TEST
    if (FROM_CAMERA) return CULLS_BACK_FACES;
#endif
    return false;
}

// Whether a hit counts. Without SKIPS_HIDDEN, alpha test and culling every hit does, and nothing is read. u, v:
// barycentric weights of the hit.
bool is_accepted(Shear shear, Triangle triangle, uint triangle_ix, float u, float v) {
    if (passes_back_faces() && is_culled(shear, triangle, triangle_ix)) return false;
    if (has_alpha_test()) return !fails_alpha_test(triangle_ix, u, v, TESTS_BLENDED);
    if (SKIPS_HIDDEN) return (load_triangle_materials(triangle_ix) & TRIANGLE_HIDDEN) == 0u;
    return true;
}

// A hit of a stored triangle as one of the world.
Hit in_world(Hit hit) {
    if (INSTANCED) {
        hit.triangle_ix -= placed.to_row;
        if (is_mirrored()) return Hit(hit.t, hit.triangle_ix, hit.v, hit.u);
    }
    return hit;
}

// Tests a triangle against the ray, and keeps the hit in `best` if it is nearer. row: the triangle's in `triangles`.
void intersect(TraversalRay ray, Triangle triangle, uint row, inout Nearest best) {
    Hit hit;
    if (!intersect_triangle(ray.shear, triangle, row, hit)) return;
    hit = in_world(hit);
    // An H200's compiler gives the search 40 registers with `row` here, and 48 with what the test returns.
    uint triangle_ix = INSTANCED ? hit.triangle_ix : row;
    if (!is_better(ray, hit.t, triangle_ix, best)) return;
    if (is_accepted(ray.shear, triangle, triangle_ix, hit.u, hit.v)) {
        best = Nearest(hit.t, triangle_ix);
        spill_pair(WEIGHTS_SLOT, hit.u, hit.v);
    }
}

// Whether the search can end because it needs only one hit and has one.
bool is_done(bool any_hit, Nearest best) {
    return any_hit && best.triangle_ix != NO_TRIANGLE;
}
