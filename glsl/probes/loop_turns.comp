#version 460
// Measures how many turns a loop may take: some drivers silently end a shader after a certain number of turns. The
// only invocation counts the turns of a loop of n_turns.
// Writes the number of turns to counts[0].
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 0) buffer CountsBlock { uint counts[]; };
layout(push_constant) uniform TurnsBlock { uint n_turns; };

void main() {
    for (uint turn = 0u; turn < n_turns; ++turn) counts[0] = turn + 1u;
}
