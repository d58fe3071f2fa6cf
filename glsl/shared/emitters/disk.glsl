// Disks that shine to one side. A point is sampled uniformly on the area. Twin of src/reference/emitters/disk.rs.
#ifndef KDRAY_DISK
#define KDRAY_DISK

#include "layout.glsl"
#include "emitters/light_sample.glsl"
#include "emitters/rectangle.glsl"

// Distance at which a ray meets the disk's front, in lengths of its direction; infinity if it does not.
float hit_disk(AreaLight light, vec3 origin, vec3 direction) {
    float t = hit_plane(light, origin, direction);
    vec3 from_centre = origin + t * direction - light.position;
    return dot(from_centre, from_centre) <= light.radius * light.radius ? t : INFINITY;
}

// A point of the unit disk, uniform on its area (Shirley, Chiu: A Low Distortion Map Between Disk and Square, 1997).
vec2 disk_point(vec2 u) {
    vec2 at = 2.0 * u - 1.0;
    if (at.x == 0.0 && at.y == 0.0) return vec2(0.0);
    bool is_wide = abs(at.x) > abs(at.y);
    float radius = is_wide ? at.x : at.y;
    float eighth = 0.25 * PI * (is_wide ? at.y / at.x : at.x / at.y);
    return is_wide ? radius * vec2(cos(eighth), sin(eighth)) : radius * vec2(sin(eighth), cos(eighth));
}

LightSample sample_disk(AreaLight light, vec3 point_world, vec2 u) {
    vec2 place = light.radius * disk_point(u);
    Towards way = towards(point_world, light.position + place.x * light.edge_u + place.y * light.edge_v);
    float pdf = light.probability * flat_pdf(light, way.direction, way.distance);
    return sample_of_point(way, light.radiance, pdf);
}

#endif
