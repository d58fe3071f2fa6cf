#version 460
// Does fma round once? One invocation subtracts a rounded square from the square: what rounding took, or zero where fma
// is a product and a sum.
// Reads and writes numbers: [0] the number, [1] the result.
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 0) buffer NumbersBlock { float numbers[]; };

void main() {
    float x = numbers[0];
    precise float square = x * x;
    precise float rest = fma(x, x, -square);
    numbers[1] = rest;
}
