#version 460
// Measures how many iterations a loop may take: some drivers silently end a shader after a certain number of
// iterations. The only invocation counts the iterations of a loop of n_iterations. Writes the number of iterations to
// counts[0].
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 0) buffer CountsBlock { uint counts[]; };
layout(push_constant) uniform IterationsBlock { uint n_iterations; };

void main() {
    for (uint iteration = 0u; iteration < n_iterations; ++iteration) counts[0] = iteration + 1u;
}
