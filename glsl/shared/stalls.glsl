// Rays that stop on their way through the tree, and go on in a further dispatch.
//
// Some drivers end a shader after a number of turns of its loops, and say nothing: the lavapipe of Mesa 22.3 does so after
// 65,535 turns of the eight lanes that it runs together. So an invocation counts its turns. When TURN_BUDGET of them are
// spent, it stores the state of its ray in a slot and leaves a mark in place of the result; the host repeats the dispatch
// until no ray is marked (src/buffers/stalls.rs). Drivers without such a limit have a budget of 0, with which all of this
// is compiled out.
#ifndef KDRAY_STALLS
#define KDRAY_STALLS

#include "layout.glsl"

layout(constant_id = CONSTANT_TURN_BUDGET) const uint TURN_BUDGET = 0u;
const bool CAN_STALL = TURN_BUDGET != 0u;

// STALLED_RAY_ROWS rows: the state of a ray that has stalled. The cell that it is in (node_offset: its node's place in kd_nodes, in bytes;
// t in halves of the ray's own), the entries of the leaf that are still to be tested, and the nearest hit so far.
// siblings_done: the words of the mask of TRAVERSAL_MASK_BOXES; other traversals find their pending subtrees again.
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

// One row. n_slots: slots that have been asked for; n_stalled: rays of the last dispatch that have stalled and have a
// slot; n_waiting: rays that have none.
struct StallCounts {
    uint n_slots;
    uint n_stalled;
    uint n_waiting;
    uint reserved;
};

// One buffer for both: some devices bind no more than 30 in a stage.
layout(std430, set = 0, binding = BIND_STALLS) buffer StallsBlock {
    StallCounts stall_counts;
    StalledRay stalled_rays[];
};

// Turns that this invocation has taken.
uint n_turns = 0u;

// To be called in every turn of every loop of a traversal.
void count_turn() {
    if (CAN_STALL) n_turns += 1u;
}

bool has_turns() {
    return TURN_BUDGET == 0u || n_turns < TURN_BUDGET;
}

// Slot of the ray's stored state, or NO_SLOT for a ray that begins.
uint resumed_slot = NO_SLOT;

bool is_resumed() {
    return CAN_STALL && resumed_slot != NO_SLOT;
}

bool is_stalled(uint mark) {
    return CAN_STALL && mark >= STALLED && mark != NO_TRIANGLE;
}

// Whether a ray runs in this round (ROUND_*). mark: what the round before has left in place of its result.
bool runs_in_round(uint round, uint mark) {
    if (TURN_BUDGET == 0u || round == ROUND_BEGIN) return true;
    if (!is_stalled(mark)) return false;
    uint slot = mark & ~STALLED;
    if (round == ROUND_RESUME) resumed_slot = slot;
    return (slot == NO_SLOT) == (round == ROUND_RESTART);
}

// Stores a ray's state in the ray's slot, or in a new one. Returns the mark that is to take the place of its result. A ray
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
