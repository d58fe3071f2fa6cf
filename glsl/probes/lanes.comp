#version 460
// Measures how many workgroups the device runs at once. Each of many workgroups counts itself in, runs for n_iterations
// loop iterations, and counts itself out.
// Reads and writes counts: [0] the workgroups that are running, [1] the most that have run at once, [2] a word that
// nobody reads, which keeps the loop from being optimized away.
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 0) buffer CountsBlock { uint counts[]; };
layout(push_constant) uniform StayBlock { uint n_iterations; };

void main() {
    if (gl_LocalInvocationIndex == 0u) atomicMax(counts[1], atomicAdd(counts[0], 1u) + 1u);
    // A compiler cannot leave out any step of this chain, since its end may be written.
    uint x = gl_GlobalInvocationID.x;
    for (uint iteration = 0u; iteration < n_iterations; ++iteration) x = x * 1664525u + 1013904223u;
    if (x == 0u) counts[2] = x;
    barrier();
    if (gl_LocalInvocationIndex == 0u) atomicAdd(counts[0], 0xffffffffu);
}
