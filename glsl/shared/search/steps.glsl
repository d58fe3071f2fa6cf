// Counts of steps. A step is a read of the acceleration structure by a ray.
//
// Needs a constant `bool COUNT_COSTS`, which the kernel declares before it includes this file. If it is false, the
// counting is compiled out. Provides `count_steps`, `steps_so_far` and `n_steps`.
#ifndef KDRAY_STEPS
#define KDRAY_STEPS

// Reads so far: nodes, slabs, cells of a grid, and triangles of leaves.
uint n_steps = 0u;

void count_steps(uint n) {
    if (COUNT_COSTS) n_steps += n;
}

uint steps_so_far() {
    return COUNT_COSTS ? n_steps : 0u;
}

#endif
