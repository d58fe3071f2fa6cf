// Suspended rays, which stop during the search and continue in a further dispatch.
//
// Some drivers silently end a shader after a number of loop iterations: lavapipe of Mesa 22.3 does so after 65,535
// iterations of the eight lanes that it runs together. So an invocation counts its iterations. When ITERATION_BUDGET
// iterations are spent, it stores the state of its ray in a slot, and writes a mark in place of the result. The host
// repeats the dispatch until no ray is marked (src/buffers/suspended_rays.rs). Drivers without such a limit have a
// budget of 0, with which all of this is compiled out.
//
// Needs nothing: it includes layout.glsl and declares the binding. Provides `count_iteration` and `has_iterations` for
// loops, `SuspendedRay`, `suspend`, `is_resumed` and `resumed_slot` for searches, `is_suspended` and `runs_in_pass` for
// kernels.
#ifndef KDRAY_SUSPENDED_RAYS
#define KDRAY_SUSPENDED_RAYS

#include "layout.glsl"

layout(constant_id = CONSTANT_ITERATION_BUDGET) const uint ITERATION_BUDGET = 0u;
const bool CAN_SUSPEND = ITERATION_BUDGET != 0u;

// The state of a ray that was suspended, SUSPENDED_RAY_ROWS rows. All t are the traversal's, half of the ray's own.
//
// node_offset, t_enter, t_exit: the cell that the ray is in (kdtree/kd_nodes.glsl). entry_ix, end_ix: the entries of
// the leaf that are still to be tested. t_best, triangle_ix, u, v: the nearest hit so far. n_steps: reads so far
// (steps.glsl). siblings_done: the mask of TRAVERSAL_MASK_BOXES; the other traversals of the kd-tree rebuild their
// pending subtrees or store none. grid/grid.glsl stores the packed indices of the ray's cell in node_offset, and those
// of the cell of the upper level in siblings_done.x.
//
// In a world of instances, top_node and top_pending are the ray's place in the hierarchy, and t_outer and
// outer_triangle the nearest hit in the instances before, with the t of the world; all others are about the geometry
// that the ray is in. If it is in none, node_offset is NO_TRIANGLE.
struct SuspendedRay {
    uint node_offset;
    float t_enter;
    float t_exit;
    uint entry_ix;
    uint end_ix;
    float t_best;
    uint triangle_ix;
    float u;
    float v;
    uint n_steps;
    uvec2 siblings_done;
    uint top_node;
    uint top_pending;
    float t_outer;
    uint outer_triangle;
};

// The counts of suspended rays, one row. n_slots: slots that rays have requested, which can be more than there are.
// n_suspended: rays of the last dispatch that were suspended and have a slot. n_waiting: suspended rays that have no
// slot, which the host keeps counted through passes of PASS_RESUME.
struct SuspendedCounts {
    uint n_slots;
    uint n_suspended;
    uint n_waiting;
    uint reserved;
};

// One buffer holds the counts and the rays, since some devices bind no more than 30 buffers in a stage.
layout(std430, set = 0, binding = BIND_SUSPENDED_RAYS) buffer SuspendedRaysBlock {
    SuspendedCounts suspended_counts;
    SuspendedRay suspended_rays[];
};

// The search through the instances while a ray is in one of them (accel.glsl).
struct OuterSearch {
    uint top_node;
    uint top_pending;
    float t;
    uint triangle_ix;
};
OuterSearch outer = OuterSearch(0u, 0u, 0.0, 0u);

// Iterations that this invocation has taken.
uint n_iterations = 0u;

// Counts an iteration. The loops of a search call this in every iteration, directly or by `kd_node`. Loops of a few
// iterations inside a counted iteration, and the loops of `walk_to` (kdtree/resume.glsl), are not counted: the budget
// leaves room for them (src/buffers/suspended_rays.rs).
void count_iteration() {
    if (CAN_SUSPEND) n_iterations += 1u;
}

// Whether the invocation may take further iterations.
bool has_iterations() {
    return ITERATION_BUDGET == 0u || n_iterations < ITERATION_BUDGET;
}

// Slot of the ray's stored state, or NO_SLOT if the ray starts from its beginning.
uint resumed_slot = NO_SLOT;

// Whether the ray has still to go on where it was suspended.
bool resumes = false;

bool is_resumed() {
    return CAN_SUSPEND && resumes;
}

// Whether a result is the mark of a suspended ray.
bool is_suspended(uint mark) {
    return CAN_SUSPEND && mark >= SUSPENDED && mark != NO_TRIANGLE;
}

// Whether a ray runs in this pass (PASS_*). Sets `resumed_slot` in PASS_RESUME. mark: the word that was written as
// the ray's result in the last pass in which the ray ran.
bool runs_in_pass(uint resume_pass, uint mark) {
    if (ITERATION_BUDGET == 0u || resume_pass == PASS_BEGIN) return true;
    if (!is_suspended(mark)) return false;
    uint slot = mark & ~SUSPENDED;
    if (resume_pass == PASS_RESUME) {
        resumed_slot = slot;
        resumes = slot != NO_SLOT;
    }
    return (slot == NO_SLOT) == (resume_pass == PASS_RESTART);
}

// Stores a ray's state in the ray's slot, or in a new one. Returns the mark that replaces the ray's result. A ray
// that finds no slot begins again in a later pass.
uint suspend(SuspendedRay state) {
    uint slot = resumed_slot;
    if (slot == NO_SLOT) slot = atomicAdd(suspended_counts.n_slots, 1u);
    if (slot >= uint(suspended_rays.length())) {
        atomicAdd(suspended_counts.n_waiting, 1u);
        return SUSPENDED | NO_SLOT;
    }
    suspended_rays[slot] = state;
    atomicAdd(suspended_counts.n_suspended, 1u);
    return SUSPENDED | slot;
}

#endif
