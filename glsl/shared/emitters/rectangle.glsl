// Rectangles that shine to one side. Twin of src/reference/emitters/rectangle.rs.
#ifndef KDRAY_RECTANGLE
#define KDRAY_RECTANGLE

#include "layout.glsl"
#include "emitters/light_sample.glsl"

// Distance at which a ray meets the front of a plane, in lengths of its direction; infinity if it does not.
float hit_plane(AreaLight light, vec3 origin, vec3 direction) {
    float cosine = dot(light.axis, direction);
    float t = dot(light.position - origin, light.axis) / cosine;
    return cosine < 0.0 && t > 0.0 ? t : INFINITY;
}

// Distance at which a ray meets the rectangle's front, in lengths of its direction; infinity if it does not.
float hit_rectangle(AreaLight light, vec3 origin, vec3 direction) {
    float t = hit_plane(light, origin, direction);
    vec3 from_centre = origin + t * direction - light.position;
    float u = dot(from_centre, light.edge_u) / dot(light.edge_u, light.edge_u);
    float v = dot(from_centre, light.edge_v) / dot(light.edge_v, light.edge_v);
    return abs(u) <= 1.0 && abs(v) <= 1.0 ? t : INFINITY;
}

// Pdf per steradian of a direction in which a flat light is seen at a distance, if its points are sampled uniformly.
float flat_pdf(AreaLight light, vec3 direction, float distance) {
    float facing = -dot(light.axis, direction) * light.area;
    return facing > 0.0 ? distance * distance / facing : 0.0;
}

// The distance up to which directions are sampled by solid angle, as a multiple of half the diagonal. Farther away,
// points that are sampled uniformly on the rectangle are seen from directions that are as good.
#define NEAR_DIAGONALS 4.0
// The least solid angle by which directions are sampled, steradians. The rounding of a solid angle is below 1e-6.
#define LEAST_SOLID_ANGLE 1.0e-3

// A rectangle as a point sees it. The part of the rectangle from x0 to x is seen in a solid angle that is the turn at x
// less the turn at x0, with turn(x) = angle_of(x, y1) - angle_of(x, y0).
struct SeenRectangle {
    // The ends along edge_u and edge_v, from the foot of the point in the rectangle's plane, world units.
    float x0, x1, y0, y1;
    // Distance of the point in front of the plane, world units.
    float height;
    // The turn at x0.
    float first_turn;
    // The solid angle that the rectangle fills, steradians. It is 0 if directions are not sampled by solid angle.
    float solid_angle;
};

// The arc tangent of x y / (height sqrt(x^2 + y^2 + height^2)), which is the solid angle of the rectangle between the
// foot of a point and its corner (x, y). Angles have an error of 3e-7, while Vulkan bounds those of `atan` by 1e-3. The
// angle is halved twice, and the tangent of the quarter is the argument of a polynomial, which interpolates at
// Chebyshev's points.
float angle_of(float x, float y, float height) {
    float squared = height * height;
    float both = sqrt((x * x + squared) * (y * y + squared));
    float half_tangent = x * y / (height * sqrt(x * x + y * y + squared) + both);
    float tangent = half_tangent / (1.0 + sqrt(1.0 + half_tangent * half_tangent));
    float s = tangent * tangent;
    float series = 1.0 + s * (-0.33332786 + s * (0.19974083 + s * (-0.1384849 + s * 0.07976292)));
    return 4.0 * tangent * series;
}

SeenRectangle seen_rectangle(AreaLight light, vec3 point_world) {
    SeenRectangle seen = SeenRectangle(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    vec3 to_centre = light.position - point_world;
    seen.height = -dot(to_centre, light.axis);
    float u_squared = dot(light.edge_u, light.edge_u), v_squared = dot(light.edge_v, light.edge_v);
    float most_squared = NEAR_DIAGONALS * NEAR_DIAGONALS * (u_squared + v_squared);
    if (!(seen.height > 0.0) || dot(to_centre, to_centre) > most_squared) return seen;
    float half_u = sqrt(u_squared), half_v = sqrt(v_squared);
    float x = dot(to_centre, light.edge_u) / half_u, y = dot(to_centre, light.edge_v) / half_v;
    seen.x0 = x - half_u;
    seen.x1 = x + half_u;
    seen.y0 = y - half_v;
    seen.y1 = y + half_v;
    seen.first_turn = angle_of(seen.x0, seen.y1, seen.height) - angle_of(seen.x0, seen.y0, seen.height);
    float last_turn = angle_of(seen.x1, seen.y1, seen.height) - angle_of(seen.x1, seen.y0, seen.height);
    float solid_angle = last_turn - seen.first_turn;
    seen.solid_angle = solid_angle > LEAST_SOLID_ANGLE ? solid_angle : 0.0;
    return seen;
}

// The vector from the point to a point of the rectangle. All directions to the rectangle are equally likely (Urena,
// Fajardo, King: An Area-Preserving Parametrization for Spherical Rectangles, 2013). u: in [0, 1).
vec3 vector_to_rectangle(AreaLight light, SeenRectangle seen, vec2 u) {
    float turn = seen.first_turn + u.x * seen.solid_angle;
    float squared = seen.height * seen.height, sine = sin(turn);
    // Cosines between the plane's normal and those of the planes through the point and the edges y0 and y1.
    float b0 = -seen.y0 / sqrt(seen.y0 * seen.y0 + squared), b1 = seen.y1 / sqrt(seen.y1 * seen.y1 + squared);
    float n = cos(turn) * b0 + b1;
    // 1 - b0^2 without cancellation.
    float rest = squared / (seen.y0 * seen.y0 + squared);
    float root = sqrt(max(n * n - rest * sine * sine, 1.0e-20));
    float x = clamp(seen.height * sine * sign(n) / root, seen.x0, seen.x1);
    float across = x * x + squared;
    float low = seen.y0 / sqrt(across + seen.y0 * seen.y0), high = seen.y1 / sqrt(across + seen.y1 * seen.y1);
    float at = low + u.y * (high - low);
    float y = clamp(at * sqrt(across / max(1.0 - at * at, 1.0e-20)), seen.y0, seen.y1);
    return x * normalize(light.edge_u) + y * normalize(light.edge_v) - seen.height * light.axis;
}

// Pdf per steradian with which sample_rectangle samples a direction in which the rectangle is seen at a distance,
// without the probability of the light.
float rectangle_pdf(AreaLight light, vec3 point_world, vec3 direction, float distance) {
    SeenRectangle seen = seen_rectangle(light, point_world);
    return seen.solid_angle > 0.0 ? 1.0 / seen.solid_angle : flat_pdf(light, direction, distance);
}

LightSample sample_rectangle(AreaLight light, vec3 point_world, vec2 u) {
    SeenRectangle seen = seen_rectangle(light, point_world);
    if (seen.solid_angle > 0.0) {
        Towards way = towards(vec3(0.0), vector_to_rectangle(light, seen, u));
        return sample_of_point(way, light.radiance, light.probability / seen.solid_angle);
    }
    vec3 point = light.position + (2.0 * u.x - 1.0) * light.edge_u + (2.0 * u.y - 1.0) * light.edge_v;
    Towards way = towards(point_world, point);
    float pdf = light.probability * flat_pdf(light, way.direction, way.distance);
    return sample_of_point(way, light.radiance, pdf);
}

#endif
