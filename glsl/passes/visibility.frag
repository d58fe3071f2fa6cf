#version 460
// Visibility (the paper's section 2.2): one invocation per fragment writes its triangle's index to the R32_UINT
// target, in which the depth test leaves the nearest triangle of each pixel.
layout(location = 0) flat in uint triangle_ix;
layout(location = 0) out uint triangle_id;

void main() {
    triangle_id = triangle_ix;
}
