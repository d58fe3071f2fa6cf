// A ray as a search through an acceleration structure takes it, and the part of it that is in the structure's box. A part of
// accel.glsl.

// What the traversal needs of a ray. It meets the plane at x on an axis at t = x * inv_direction + bias.
//
// All t of the traversal are half of the ray's own: the middle of an interval then is the sum of its ends, and half its length
// their difference (slab.glsl). Halving loses no bits.
//
// This t is rounded, and taken as exact: that is the same as if the plane lay a little off, and a leaf has all triangles
// that come so near to it (kdtree/bounds.rs). The hit test's rounding is allowed for there too. So what brute force
// finds, the traversal finds, along planes and through corners of cells as elsewhere.
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
    // A direction in the plane is taken as all but in it: finite everywhere, and one rule for all ties.
    vec3 tiny = vec3(KD_LEAST_COMPONENT);
    r.inv_direction = 0.5 / mix(ray.direction, tiny, lessThan(abs(ray.direction), tiny));
    r.bias = -ray.origin * r.inv_direction;
    precise vec3 t0 = fma(accel.cell_min, r.inv_direction, r.bias);
    precise vec3 t1 = fma(accel.cell_max, r.inv_direction, r.bias);
    vec3 near = min(t0, t1);
    vec3 far = max(t0, t1);
    r.t_enter = max(max(near.x, near.y), max(near.z, 0.5 * t_min));
    r.t_exit = min(min(far.x, far.y), min(far.z, 0.5 * ray.t_max));
    return r;
}

// Whether the ray meets the box that holds all triangles.
bool is_in(TraversalRay ray) {
    return ray.t_enter <= ray.t_exit;
}

float largest_coordinate() {
    vec3 largest = max(abs(accel.cell_min), abs(accel.cell_max));
    return max(largest.x, max(largest.y, largest.z));
}

// The ray with its origin moved along it to lie within KD_MAX_ORIGIN_DISTANCE. t_start: how far; 0 for all but cameras far away.
PathRay near_scene(PathRay ray, out float t_start) {
    vec3 away = abs(ray.origin);
    t_start = 0.0;
    if (max(away.x, max(away.y, away.z)) <= KD_MAX_ORIGIN_DISTANCE * largest_coordinate()) return ray;
    t_start = 2.0 * max(traversal_ray(ray, 0.0).t_enter, 0.0);
    precise vec3 origin = ray.origin + t_start * ray.direction;
    ray.origin = origin;
    ray.t_max -= t_start;
    return ray;
}
