// Rectangles that shine to one side. Twin of src/reference/emitters/rectangle.rs.
#ifndef KDRAY_RECTANGLE
#define KDRAY_RECTANGLE

#include "layout.glsl"
#include "emitters/pick.glsl"

// Distance at which a ray meets the front of a plane, in lengths of its direction; infinity if it does not.
float hit_plane(AreaLight light, vec3 origin, vec3 direction) {
    float cosine = dot(light.axis, direction);
    float t = dot(light.position - origin, light.axis) / cosine;
    return cosine < 0.0 && t > 0.0 ? t : uintBitsToFloat(0x7f800000u);
}

// Distance at which a ray meets the rectangle's front, in lengths of its direction; infinity if it does not.
float hit_rectangle(AreaLight light, vec3 origin, vec3 direction) {
    float t = hit_plane(light, origin, direction);
    vec3 from_centre = origin + t * direction - light.position;
    float u = dot(from_centre, light.edge_u) / dot(light.edge_u, light.edge_u);
    float v = dot(from_centre, light.edge_v) / dot(light.edge_v, light.edge_v);
    return abs(u) <= 1.0 && abs(v) <= 1.0 ? t : uintBitsToFloat(0x7f800000u);
}

// Density per steradian of a direction in which a flat light is seen at a distance, if its points are picked uniformly.
float flat_density(AreaLight light, vec3 direction, float distance) {
    float facing = -dot(light.axis, direction) * light.area;
    return facing > 0.0 ? distance * distance / facing : 0.0;
}

LightPick pick_rectangle(AreaLight light, vec3 point_world, vec2 u) {
    vec3 point = light.position + (2.0 * u.x - 1.0) * light.edge_u + (2.0 * u.y - 1.0) * light.edge_v;
    Towards way = towards(point_world, point);
    float density = light.probability * flat_density(light, way.direction, way.distance);
    return pick_of_point(way, light.radiance, density);
}

#endif
