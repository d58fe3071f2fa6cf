// The studio around a scene without light of its own whose metals or glass would mirror an even background: a bright
// ceiling, three soft boxes, and a floor darker than the background, without which a polished box would show the
// background on its sides and vanish before it. Camera rays do not see it. Twin of src/reference/studio.rs.
//
// Needs the uniform buffer `frame`.
#ifndef KDRAY_STUDIO
#define KDRAY_STUDIO

#include "layout.glsl"
#include "frame.glsl"

// Radiance of the ceiling in the zenith. Towards the horizon it falls to 0.
const float STUDIO_CEILING = 0.5;
// Share of the background's radiance that the floor lacks, and how far below the horizon it lacks all of that, as a
// sine.
const float STUDIO_FLOOR = 0.6;
const float STUDIO_HORIZON = 0.1;
// Width of a box's soft edge, as a tangent from the box's middle.
const float STUDIO_EDGE = 0.08;

// The radiance of a box. Directions are in the frame of the studio: to the right, up, and towards the viewer.
// azimuth, elevation: sine and cosine of the angles of the box's middle. half_size: tangents of half its angles.
float studio_box(vec3 local, vec4 azimuth_elevation, vec2 half_size, float radiance) {
    vec2 azimuth = azimuth_elevation.xy, elevation = azimuth_elevation.zw;
    vec3 middle = vec3(azimuth.x * elevation.y, elevation.x, azimuth.y * elevation.y);
    vec3 across = vec3(azimuth.y, 0.0, -azimuth.x);
    vec3 along = vec3(-azimuth.x * elevation.x, elevation.y, -azimuth.y * elevation.x);
    float depth = dot(local, middle);
    if (depth <= 0.0) return 0.0;
    vec2 place = abs(vec2(dot(local, across), dot(local, along))) / depth;
    vec2 share = clamp((half_size - place) / STUDIO_EDGE, 0.0, 1.0);
    return radiance * share.x * share.y;
}

// The radiance that the studio adds to that of the background, for a ray that leaves the scene after its first hit.
// The floor is darker than the background, so it adds a negative radiance.
vec3 studio_radiance(vec3 direction) {
    if (frame.has_studio == 0u) return vec3(0.0);
    vec3 up = frame.up_axis == 2u ? vec3(0.0, 0.0, 1.0) : vec3(0.0, 1.0, 0.0);
    vec3 right = cross(up, frame.to_viewer);
    vec3 local = vec3(dot(direction, right), dot(direction, up), dot(direction, frame.to_viewer));
    float sum = STUDIO_CEILING * max(local.y, 0.0);
    // The sines and cosines of -50 and 40 degrees, of 75 and 15, and of 160 and 40.
    sum += studio_box(local, vec4(-0.7660444, 0.6427876, 0.6427876, 0.7660444), vec2(0.5, 0.4), 2.4);
    sum += studio_box(local, vec4(0.9659258, 0.2588190, 0.2588190, 0.9659258), vec2(0.25, 0.7), 1.2);
    sum += studio_box(local, vec4(0.3420201, -0.9396926, 0.6427876, 0.7660444), vec2(0.6, 0.2), 1.6);
    return vec3(sum) - STUDIO_FLOOR * clamp(-local.y / STUDIO_HORIZON, 0.0, 1.0) * frame.background;
}

#endif
