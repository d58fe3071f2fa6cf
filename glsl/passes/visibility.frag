#version 460
// Visibility (the paper's section 2.2): the nearest triangle's index into each pixel of the R32_UINT target.
layout(location = 0) flat in uint triangle_ix;
layout(location = 0) out uint triangle_id;

void main() {
    triangle_id = triangle_ix;
}
