// What rays that leave the scene see: a map, or the background, and the suns. Twin of
// src/reference/emitters/environment.rs.
//
// The map is equirectangular. Its rows go from the zenith, +y, down to -y. Its middle is in the direction -z, and the
// quarter to the right of it is +x. `environment_turn` turns it about +y.
//
// A row is picked first, and then a texel of the row, each by an alias table. Within the texel, directions are uniform.
//
// Needs the words of textures (texture_words.glsl).
#ifndef KDRAY_ENVIRONMENT
#define KDRAY_ENVIRONMENT

#include "layout.glsl"
#include "texture_words.glsl"
#include "emitters/alias.glsl"
#include "emitters/kinds.glsl"
#include "emitters/pick.glsl"
#include "emitters/sun.glsl"

// A texel: colour, and the density of its directions, per steradian.
vec4 environment_texel(uint x, uint y) {
    uint n_rows = accel.environment_height, n_columns = accel.environment_width;
    uint at = accel.environment_begin + 2u * (n_rows + n_rows * n_columns) + 4u * (y * n_columns + x);
    return vec4(load_float(at), load_float(at + 1u), load_float(at + 2u), load_float(at + 3u));
}

// Where a direction is in the map: to the right and down, both 0 to 1.
vec2 environment_place(vec3 direction) {
    float turns = atan(direction.x, -direction.z) / (2.0 * EMITTER_PI) + 0.5 + accel.environment_turn;
    float aside = sqrt(direction.x * direction.x + direction.z * direction.z);
    return vec2(turns - floor(turns), atan(aside, direction.y) / EMITTER_PI);
}

// The map's colour at a place, bilinear between the middles of texels.
vec3 map_colour(vec2 place) {
    uint width = accel.environment_width, height = accel.environment_height;
    vec2 at = place * vec2(width, height) - 0.5;
    ivec2 low = ivec2(floor(at));
    vec2 weight = at - vec2(low);
    vec3 rows[2];
    for (int i = 0; i < 2; ++i) {
        uint y = uint(clamp(low.y + i, 0, int(height) - 1));
        uint left = low.x < 0 ? width - 1u : min(uint(low.x), width - 1u);
        uint right = left + 1u < width ? left + 1u : 0u;
        vec3 a = environment_texel(left, y).rgb;
        rows[i] = a + (environment_texel(right, y).rgb - a) * weight.x;
    }
    return rows[0] + (rows[1] - rows[0]) * weight.y;
}

// The density of the direction at a place if the environment without the suns is picked, per steradian.
float map_density(vec2 place) {
    uint width = accel.environment_width, height = accel.environment_height;
    vec2 at = place * vec2(width, height);
    return environment_texel(min(uint(at.x), width - 1u), min(uint(at.y), height - 1u)).w;
}

// What a ray that leaves the scene meets: the environment and its suns. density: with which pick_light picks the
// direction because of them, per steradian.
struct SeenEnvironment {
    vec3 radiance;
    float density;
};

// What a ray in this direction meets beyond the scene.
SeenEnvironment seen_environment(vec3 direction) {
    SeenEnvironment seen = SeenEnvironment(accel.background, 1.0 / (4.0 * EMITTER_PI));
    if (HAS_ENVIRONMENT_MAP) {
        vec2 place = environment_place(direction);
        seen = SeenEnvironment(map_colour(place), map_density(place));
    }
    SeenSuns suns = seen_suns(direction);
    float density = accel.environment_probability * seen.density + suns.density;
    return SeenEnvironment(seen.radiance + suns.radiance, density);
}

// The radiance that surfaces get from a direction in addition: from the sky or from the ground. Neither the camera nor
// mirrors see it.
vec3 ambient_radiance(vec3 direction) {
    return direction[accel.up_axis] < 0.0 ? accel.ground_ambient : accel.ambient;
}

// A direction of the environment, and its density without the suns, per steradian.
struct MapPick {
    vec3 direction;
    float density;
};

// A direction of the map. 1 - |cos| of the polar angle is interpolated, which is exact at the poles.
MapPick pick_map_direction(vec2 u) {
    uint n_rows = accel.environment_height, n_columns = accel.environment_width;
    AliasPick row = pick_alias(accel.environment_begin, 2u, n_rows, u.x, 0.0);
    uint columns_begin = accel.environment_begin + 2u * (n_rows + row.ix * n_columns);
    AliasPick column = pick_alias(columns_begin, 2u, n_columns, u.y, 0.0);
    bool is_upper = 2u * row.ix < n_rows;
    // Rows from the nearer pole to both edges of the row. The middle row of an odd number is bounded by the equator's
    // far side, which the formulas allow.
    float first = is_upper ? float(row.ix) : float(n_rows - 1u - row.ix);
    vec2 sines = sin(0.5 * EMITTER_PI / float(n_rows) * vec2(first, first + 1.0));
    vec2 versines = 2.0 * sines * sines;
    float share = is_upper ? row.rest : 1.0 - row.rest;
    float versine = versines.x + (versines.y - versines.x) * share;
    float sine = sqrt(max(versine * (2.0 - versine), 0.0));
    float turns = (float(column.ix) + column.rest) / float(n_columns) - 0.5 - accel.environment_turn;
    float azimuth = 2.0 * EMITTER_PI * turns;
    float up = is_upper ? 1.0 - versine : versine - 1.0;
    vec3 direction = vec3(sine * sin(azimuth), up, -sine * cos(azimuth));
    return MapPick(direction, environment_texel(column.ix, row.ix).w);
}

// A direction, uniform on the sphere.
MapPick pick_any_direction(vec2 u) {
    float up = 1.0 - 2.0 * u.x;
    float sine = 2.0 * sqrt(max(u.x * (1.0 - u.x), 0.0));
    float azimuth = 2.0 * EMITTER_PI * u.y;
    return MapPick(vec3(sine * sin(azimuth), up, -sine * cos(azimuth)), 1.0 / (4.0 * EMITTER_PI));
}

// The pick of a direction beyond the scene.
LightPick pick_beyond(vec3 direction, SeenEnvironment seen) {
    Towards way = Towards(direction, uintBitsToFloat(0x7f800000u));
    return pick_of_point(way, seen.radiance + ambient_radiance(direction), seen.density);
}

LightPick pick_environment(vec2 u) {
    // The density is that of the texel that was picked. Rounding may move the direction to its neighbour.
    MapPick pick = HAS_ENVIRONMENT_MAP ? pick_map_direction(u) : pick_any_direction(u);
    vec3 radiance = HAS_ENVIRONMENT_MAP ? map_colour(environment_place(pick.direction)) : accel.background;
    SeenSuns suns = seen_suns(pick.direction);
    float density = accel.environment_probability * pick.density + suns.density;
    return pick_beyond(pick.direction, SeenEnvironment(radiance + suns.radiance, density));
}

LightPick pick_sun(uint sun_ix, vec2 u) {
    vec3 direction = sun_direction(sun_ix, u);
    return pick_beyond(direction, seen_environment(direction));
}

#endif
