// Unit vectors as octahedral 2 x snorm16 codes (Cigolle et al.: Survey of Efficient Representations for Independent
// Unit Vectors, JCGT 2014). Twin of src/layout/normal.rs. Needs nothing; provides `decode_normal` and `encode_normal`.
#ifndef KDRAY_OCTAHEDRAL
#define KDRAY_OCTAHEDRAL

vec3 decode_normal(uint code) {
    vec2 p = unpackSnorm2x16(code);
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float fold = max(-n.z, 0.0);
    n.x += n.x >= 0.0 ? -fold : fold;
    n.y += n.y >= 0.0 ? -fold : fold;
    return normalize(n);
}

// The code of a direction of any length. `precise`, for kernels whose result must not depend on contraction.
uint encode_normal(vec3 n) {
    precise vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    precise vec2 folded = (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    return packSnorm2x16(n.z >= 0.0 ? p : folded);
}

#endif
