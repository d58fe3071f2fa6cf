// What an invocation's rays read of the tree. Who includes this says before whether to count, by COUNT_COSTS, a constant;
// where it is false, nothing is left of the counting.
#ifndef KDRAY_STEPS
#define KDRAY_STEPS

// Nodes, and triangles of leaves, so far.
uint n_steps = 0u;

void count_steps(uint n) {
    if (COUNT_COSTS) n_steps += n;
}

uint steps_so_far() {
    return COUNT_COSTS ? n_steps : 0u;
}

#endif
