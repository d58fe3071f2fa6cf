// The point of a triangle that is closest to the origin. Twin of src/reference/point_triangle.rs.
//
// The candidates are the closest points of the three edges, and the foot of the perpendicular if it is inside. The foot
// is found by steps along the longest edge and along the height, which are perpendicular even in needles: the rounding
// of the height's direction moves the foot along the height by as much as the triangle is wide at most. So each
// candidate is in the triangle, and the distance of the best one is right to 2^-20 of the distance to the farthest
// corner. Where the triangle is not much larger than its distance, that is the rounding of the distance itself.
//
// Needs nothing. Provides `PointOnTriangle` and `closest_on_triangle`.
#ifndef KDRAY_POINT_TRIANGLE
#define KDRAY_POINT_TRIANGLE

// A point of a triangle: the square of its distance from the origin, and the weights of the second and third corner.
struct PointOnTriangle {
    float squared;
    float u;
    float v;
};

// `precise`: the twin computes the same bits, but for divisions.
float dot_in_order(vec3 a, vec3 b) {
    precise float product = a.x * b.x + a.y * b.y + a.z * b.z;
    return product;
}

// Replaces the best point by the one with these weights, if that is closer.
void take_closer(vec3 a, vec3 b, vec3 c, float u, float v, inout PointOnTriangle best) {
    precise float w = 1.0 - u - v;
    precise vec3 point = w * a + u * b + v * c;
    float squared = dot_in_order(point, point);
    if (squared < best.squared) best = PointOnTriangle(squared, u, v);
}

// The place of the origin's foot on the line from a along an edge, as a share of the edge. 0 if the edge has no length.
float share_along(vec3 a, vec3 edge, float edge_squared) {
    return edge_squared > 0.0 ? -dot_in_order(a, edge) / edge_squared : 0.0;
}

// The edge's point that is closest to the origin, as a share of the edge: 0 at a, 1 at the other end. On a GPU, x / x
// need not be 1, and x / y may exceed 1 though x < y. So comparisons find the ends, and the quotient is limited.
float share_on(vec3 a, vec3 edge) {
    float along = -dot_in_order(a, edge), squared = dot_in_order(edge, edge);
    return along <= 0.0 ? 0.0 : along >= squared ? 1.0 : min(along / squared, 1.0);
}

// `closest_on_triangle` if the edge from a to b is the longest one.
PointOnTriangle closest_beside_longest(vec3 a, vec3 b, vec3 c) {
    precise vec3 ab = b - a;
    precise vec3 ac = c - a;
    precise vec3 bc = c - b;
    float ab_squared = dot_in_order(ab, ab);
    float along_ab = share_along(a, ab, ab_squared);
    float along_bc = share_on(b, bc);
    PointOnTriangle best = PointOnTriangle(dot_in_order(a, a), 0.0, 0.0);
    take_closer(a, b, c, share_on(a, ab), 0.0, best);
    take_closer(a, b, c, 0.0, share_on(a, ac), best);
    take_closer(a, b, c, 1.0 - along_bc, along_bc, best);
    float height_along_ab = -share_along(ac, ab, ab_squared);
    precise vec3 height = ac - height_along_ab * ab;
    precise vec3 foot = a + along_ab * ab;
    float v = share_along(foot, height, dot_in_order(height, height));
    precise float u = along_ab - v * height_along_ab;
    precise float w = 1.0 - u - v;
    if (u > 0.0 && v > 0.0 && w > 0.0) take_closer(a, b, c, u, v, best);
    return best;
}

PointOnTriangle closest_on_triangle(vec3 a, vec3 b, vec3 c) {
    precise vec3 ab = b - a;
    precise vec3 bc = c - b;
    precise vec3 ca = a - c;
    float ab_squared = dot_in_order(ab, ab), bc_squared = dot_in_order(bc, bc), ca_squared = dot_in_order(ca, ca);
    if (bc_squared > ab_squared && bc_squared >= ca_squared) {
        PointOnTriangle turned = closest_beside_longest(b, c, a);
        precise float u = 1.0 - turned.u - turned.v;
        return PointOnTriangle(turned.squared, max(u, 0.0), turned.u);
    }
    if (ca_squared > ab_squared) {
        PointOnTriangle turned = closest_beside_longest(c, a, b);
        precise float v = 1.0 - turned.u - turned.v;
        return PointOnTriangle(turned.squared, turned.v, max(v, 0.0));
    }
    return closest_beside_longest(a, b, c);
}

#endif
