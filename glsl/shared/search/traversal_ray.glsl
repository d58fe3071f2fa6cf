// A ray in the form that searches through an acceleration structure use, and its interval in the structure's box. A
// part of accel.glsl.
//
// Needs scene.glsl and triangle.glsl. Provides `TraversalRay`, `traversal_ray`, `is_in` and `near_scene`.

// What is searched: all triangles, or with INSTANCED, a geometry. The first four members are those of `AccelConstants`,
// the others those of `GeometryConstants`.
struct Extent {
    vec3 box_min;
    float plane_epsilon;
    vec3 box_max;
    float origin_reach;
    uint root_offset;
    uint first_row;
    uint n_triangles;
};

// The geometry that is searched, with INSTANCED.
Extent entered;

Extent extent() {
    if (INSTANCED) return entered;
    return Extent(accel.box_min, accel.plane_epsilon, accel.box_max, accel.origin_reach, 0u, 0u, accel.n_triangles);
}

uint root_offset() {
    return extent().root_offset;
}

// A ray in the form that the traversal uses. It meets the plane at x on an axis at t = x * inv_direction + bias.
//
// All t of the traversal are half of the ray's own. So the middle of an interval, in the ray's own t, is the sum of
// its ends, and half its length is their difference (kdtree/slab.glsl). Halving loses no bits.
//
// The t of a plane is rounded, but the traversal treats it as exact. That has the effect of a plane that is slightly
// off its place, and a leaf has all triangles that are so near to its cell (src/accel/bounds.rs). The margins there
// also cover the rounding of the hit test. So the traversal finds what brute force finds, also for rays along planes
// and through corners of cells.
//
// shear: with z halved, so that hits have the traversal's t. t_min: hits have a greater t. t_enter, t_exit: the part
// of the ray's interval that is in the structure's box. source_triangle: the triangle that the ray never hits.
struct TraversalRay {
    Shear shear;
    vec3 direction;
    vec3 inv_direction;
    vec3 bias;
    float t_min;
    float t_enter;
    float t_exit;
    uint source_triangle;
};

TraversalRay traversal_ray(PathRay ray, float t_min) {
    TraversalRay r;
    r.shear = shear_of(ray.origin, ray.direction);
    r.direction = ray.direction;
    r.source_triangle = ray.source_triangle;
    r.t_min = 0.5 * t_min;
    r.shear.z *= 0.5;
    // A direction that is parallel to a split plane is replaced by one that is almost parallel to it. So all values
    // are finite, and such rays need no case of their own.
    vec3 tiny = vec3(KD_LEAST_COMPONENT);
    r.inv_direction = 0.5 / mix(ray.direction, tiny, lessThan(abs(ray.direction), tiny));
    r.bias = -ray.origin * r.inv_direction;
    precise vec3 t0 = fma(extent().box_min, r.inv_direction, r.bias);
    precise vec3 t1 = fma(extent().box_max, r.inv_direction, r.bias);
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    r.t_enter = max(max(near.x, near.y), max(near.z, 0.5 * t_min));
    r.t_exit = min(min(far.x, far.y), min(far.z, 0.5 * ray.t_max));
    return r;
}

// Whether the ray meets the box that holds all triangles. False also if an end of its interval is NaN.
bool is_in(TraversalRay ray) {
    return ray.t_enter <= ray.t_exit;
}

float largest_coordinate() {
    vec3 largest = max(abs(extent().box_min), abs(extent().box_max));
    return max(largest.x, max(largest.y, largest.z));
}

float longest_component(vec3 v) {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

// Moves a ray's origin to the point that is nearest to 0, of those with t from t_min or 0 up to t_max, if that at least
// halves its largest coordinate. Returns the distance of the move, or else 0.
float move_to_centre(inout PathRay ray, float t_min) {
    vec3 d = ray.direction;
    precise float height = ray.origin.x * d.x + ray.origin.y * d.y + ray.origin.z * d.z;
    precise float length_squared = d.x * d.x + d.y * d.y + d.z * d.z;
    float t_nearest = -height / length_squared;
    float t_move = min(max(t_nearest, min(t_min, 0.0)), ray.t_max);
    precise vec3 origin = ray.origin + t_move * d;
    if (!(2.0 * longest_component(origin) <= longest_component(ray.origin))) return 0.0;
    ray.origin = origin;
    ray.t_max -= t_move;
    return t_move;
}

// The least number above x. Returns x if that is 0 or infinity.
float next_above(float x) {
    int bits = floatBitsToInt(x);
    if (x > 0.0) return intBitsToFloat(min(bits + 1, 0x7f800000));
    return x < 0.0 ? intBitsToFloat(bits - 1) : x;
}

// Returns the ray. If its origin is beyond the limit of KD_MAX_ORIGIN_DISTANCE, it is moved along the ray to the
// structure's box. If it is then beyond origin_reach, it is moved towards 0 (src/accel/kdtree/scales.rs). t_start: the
// distance of the moves, in the ray's own t, or 0 if the origin is not moved. t_min becomes that of the returned ray,
// such that the sum of t_start and any greater t is greater than the ray's own t_min, also after rounding.
PathRay near_scene(PathRay ray, inout float t_min, out float t_start) {
    t_start = 0.0;
    if (longest_component(ray.origin) <= extent().origin_reach) return ray;
    if (longest_component(ray.origin) > KD_MAX_ORIGIN_DISTANCE * largest_coordinate()) {
        t_start = 2.0 * max(traversal_ray(ray, 0.0).t_enter, 0.0);
        precise vec3 origin = ray.origin + t_start * ray.direction;
        ray.origin = origin;
        ray.t_max -= t_start;
    }
    if (longest_component(ray.origin) > extent().origin_reach) t_start += move_to_centre(ray, t_min - t_start);
    // A greater t is at least the next number above t_min - t_start. Without next_above, the sum could round to t_min.
    if (t_start != 0.0) t_min = next_above(t_min) - t_start;
    return ray;
}
