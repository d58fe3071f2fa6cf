// Stalled rays, which stop during the search and continue in a further dispatch.
//
// Some drivers silently end a shader after a number of loop turns: lavapipe of Mesa 22.3 does so after 65,535 turns
// of the eight lanes that it runs together. So an invocation counts its turns. When TURN_BUDGET turns are spent, it
// stores the state of its ray in a slot, and writes a mark in place of the result. The host repeats the dispatch
// until no ray is marked (src/buffers/stalls.rs). Drivers without such a limit have a budget of 0, with which all of
// this is compiled out.
//
// Needs nothing: it includes layout.glsl and declares the binding. Provides `count_turn` and `has_turns` for loops,
// `StalledRay`, `stall`, `is_resumed` and `resumed_slot` for searches, `is_stalled` and `runs_in_round` for kernels.
#ifndef KDRAY_STALLS
#define KDRAY_STALLS

#include "layout.glsl"

layout(constant_id = CONSTANT_TURN_BUDGET) const uint TURN_BUDGET = 0u;
const bool CAN_STALL = TURN_BUDGET != 0u;

// The state of a ray that has stalled, STALLED_RAY_ROWS rows. All t are the traversal's, half of the ray's own.
//
// node_offset, t_enter, t_exit: the cell that the ray is in (kd_nodes.glsl). entry_ix, end_ix: the entries of the
// leaf that are still to be tested. t_best, triangle_ix, u, v: the nearest hit so far. n_steps: reads so far
// (steps.glsl). siblings_done: the mask of TRAVERSAL_MASK_BOXES; the other traversals of the kd-tree rebuild their
// pending subtrees or store none. grid.glsl stores the packed indices of the ray's cell in node_offset, and those of
// the cell of the upper level in siblings_done.x.
struct StalledRay {
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
};

// The counts of stalled rays, one row. n_slots: slots that rays have requested, which can be more than there are.
// n_stalled: rays of the last dispatch that have stalled and have a slot. n_waiting: stalled rays that have no slot,
// which the host keeps counted through rounds of ROUND_RESUME.
struct StallCounts {
    uint n_slots;
    uint n_stalled;
    uint n_waiting;
    uint reserved;
};

// One buffer holds the counts and the rays, since some devices bind no more than 30 buffers in a stage.
layout(std430, set = 0, binding = BIND_STALLS) buffer StallsBlock {
    StallCounts stall_counts;
    StalledRay stalled_rays[];
};

// Turns that this invocation has taken.
uint n_turns = 0u;

// Counts a turn. The loops of a search call this in every turn, directly or by `kd_node`. Loops of a few turns inside
// a counted turn, and the loops of `walk_to` (resume.glsl), are not counted: the budget leaves room for them
// (src/buffers/stalls.rs).
void count_turn() {
    if (CAN_STALL) n_turns += 1u;
}

// Whether the invocation may take further turns.
bool has_turns() {
    return TURN_BUDGET == 0u || n_turns < TURN_BUDGET;
}

// Slot of the ray's stored state, or NO_SLOT if the ray starts from its beginning.
uint resumed_slot = NO_SLOT;

bool is_resumed() {
    return CAN_STALL && resumed_slot != NO_SLOT;
}

// Whether a result is the mark of a stalled ray.
bool is_stalled(uint mark) {
    return CAN_STALL && mark >= STALLED && mark != NO_TRIANGLE;
}

// Whether a ray runs in this round (ROUND_*). Sets `resumed_slot` in ROUND_RESUME. mark: the word that was written as
// the ray's result in the last round in which the ray ran.
bool runs_in_round(uint round, uint mark) {
    if (TURN_BUDGET == 0u || round == ROUND_BEGIN) return true;
    if (!is_stalled(mark)) return false;
    uint slot = mark & ~STALLED;
    if (round == ROUND_RESUME) resumed_slot = slot;
    return (slot == NO_SLOT) == (round == ROUND_RESTART);
}

// Stores a ray's state in the ray's slot, or in a new one. Returns the mark that replaces the ray's result. A ray
// that finds no slot begins again in a later round.
uint stall(StalledRay state) {
    uint slot = resumed_slot;
    if (slot == NO_SLOT) slot = atomicAdd(stall_counts.n_slots, 1u);
    if (slot >= uint(stalled_rays.length())) {
        atomicAdd(stall_counts.n_waiting, 1u);
        return STALLED | NO_SLOT;
    }
    stalled_rays[slot] = state;
    atomicAdd(stall_counts.n_stalled, 1u);
    return STALLED | slot;
}

#endif
