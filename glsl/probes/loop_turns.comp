#version 460
// How many turns does a loop take? One invocation counts them, up to the number that it is given. Some drivers end a
// shader without a word after a certain number of turns.
// Writes counts: [0] the number of turns.
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 0) buffer CountsBlock { uint counts[]; };
layout(push_constant) uniform TurnsBlock { uint n_turns; };

void main() {
    for (uint turn = 0u; turn < n_turns; ++turn) counts[0] = turn + 1u;
}
