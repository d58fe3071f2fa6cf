#version 460
// Tests whether fma rounds once. The only invocation computes fma(x, x, -square), where `square` is the rounded
// square of x. The result is the rounding error of the square if fma rounds once, and 0 if it is a product and a sum.
// Reads x in numbers[0]; writes the result to numbers[1].
layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 0) buffer NumbersBlock { float numbers[]; };

void main() {
    float x = numbers[0];
    precise float square = x * x;
    precise float rest = fma(x, x, -square);
    numbers[1] = rest;
}
