// A frame around a normal, in which the lobes of surfaces are computed (Duff et al.: Building an Orthonormal Basis,
// Revisited, JCGT 2017). The normal is its z axis. Twin of src/reference/bsdf/local_frame.rs.
#ifndef KDRAY_BSDF_LOCAL_FRAME
#define KDRAY_BSDF_LOCAL_FRAME

struct LocalFrame {
    vec3 tangent;
    vec3 bitangent;
    vec3 normal;
};

LocalFrame frame_around(vec3 n) {
    float side = n.z >= 0.0 ? 1.0 : -1.0;
    float a = -1.0 / (side + n.z);
    float b = n.x * n.y * a;
    vec3 tangent = vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    return LocalFrame(tangent, vec3(b, side + n.y * n.y * a, -n.y), n);
}

vec3 to_local(LocalFrame frame, vec3 direction) {
    return vec3(dot(direction, frame.tangent), dot(direction, frame.bitangent), dot(direction, frame.normal));
}

vec3 to_world(LocalFrame frame, vec3 direction) {
    return direction.x * frame.tangent + direction.y * frame.bitangent + direction.z * frame.normal;
}

#endif
