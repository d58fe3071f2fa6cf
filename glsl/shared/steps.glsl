// What an invocation's rays read of the tree. Who includes this says whether to count: COUNT_COSTS, a constant; where it
// is 0, nothing is left of it.
#ifndef KDRAY_STEPS
#define KDRAY_STEPS

// Nodes read and triangles tested so far.
uint n_steps = 0u;

void count_steps(uint n) {
    if (COUNT_COSTS == 1u) n_steps += n;
}

#endif
