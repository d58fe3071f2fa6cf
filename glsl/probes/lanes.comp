#version 460
// How many workgroups does the device run at once? Each says that it is there, stays for a while, and leaves.
// Reads and writes counts: [0] those that are there, [1] the most that were there at once, [2] nothing that is read.
layout(local_size_x = 64) in;
layout(std430, set = 0, binding = 0) buffer CountsBlock { uint counts[]; };
layout(push_constant) uniform StayBlock { uint n_turns; };

void main() {
    if (gl_LocalInvocationIndex == 0u) atomicMax(counts[1], atomicAdd(counts[0], 1u) + 1u);
    // A chain of which no step can be left out, since its end might be written.
    uint x = gl_GlobalInvocationID.x;
    for (uint turn = 0u; turn < n_turns; ++turn) x = x * 1664525u + 1013904223u;
    if (x == 0u) counts[2] = x;
    barrier();
    if (gl_LocalInvocationIndex == 0u) atomicAdd(counts[0], 0xffffffffu);
}
