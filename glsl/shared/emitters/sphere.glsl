// Spheres that shine outwards. A direction is sampled uniformly in the cone in which the sphere is seen. From inside,
// there is no light. Twin of src/reference/emitters/sphere.rs.
#ifndef KDRAY_SPHERE
#define KDRAY_SPHERE

#include "layout.glsl"
#include "bsdf/local_frame.glsl"
#include "emitters/light_sample.glsl"

// Distance at which a ray meets the sphere from outside, in lengths of its direction, a unit vector; infinity if it
// does not. The distance of the centre from the ray's line is computed first, which keeps small and distant spheres
// exact (Haines et al.: Precision Improvements for Ray/Sphere Intersection, Ray Tracing Gems, 2019).
float hit_sphere(AreaLight light, vec3 origin, vec3 direction) {
    vec3 to_centre = light.position - origin;
    float along = dot(to_centre, direction);
    vec3 aside = to_centre - along * direction;
    float squared = light.radius * light.radius - dot(aside, aside);
    bool is_outside = dot(to_centre, to_centre) > light.radius * light.radius;
    return is_outside && along > 0.0 && squared >= 0.0 ? along - sqrt(squared) : INFINITY;
}

// 1 less the cosine of the angle between the centre of the sphere and its edge, seen from a point; 0 from inside.
// to_centre: from the point to the centre.
float sphere_versine(AreaLight light, vec3 to_centre) {
    float squared_sine = light.radius * light.radius / dot(to_centre, to_centre);
    return squared_sine < 1.0 ? squared_sine / (1.0 + sqrt(1.0 - squared_sine)) : 0.0;
}

// Pdf per steradian of the directions in which the sphere is seen; 0 from inside.
float sphere_pdf(AreaLight light, vec3 point_world) {
    float versine = sphere_versine(light, light.position - point_world);
    return versine > 0.0 ? 1.0 / (2.0 * PI * versine) : 0.0;
}

LightSample sample_sphere(AreaLight light, vec3 point_world, vec2 u) {
    Towards to_centre = towards(point_world, light.position);
    float versine = u.x * sphere_versine(light, light.position - point_world);
    float sine = sqrt(versine * (2.0 - versine));
    LocalFrame axes = frame_around(to_centre.direction);
    vec3 direction = around(axes.normal, axes.tangent, axes.bitangent, vec3(1.0 - versine, sine, u.y));
    float aside = to_centre.distance * sine;
    float half_chord = sqrt(max(light.radius * light.radius - aside * aside, 0.0));
    float distance = max(to_centre.distance * (1.0 - versine) - half_chord, 0.0);
    return sample_of_point(
        Towards(direction, distance), light.radiance, light.probability * sphere_pdf(light, point_world)
    );
}

#endif
