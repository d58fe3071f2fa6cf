// Colours that display a pixel's AOVs, already encoded for display. Needs layout.glsl before it.
#ifndef KDRAY_FALSE_COLOR
#define KDRAY_FALSE_COLOR

// A colour for an index. Neighbouring indices get different colours: the low bits of a multiplicative hash (Knuth
// 6.4).
vec3 id_color(uint id) {
    uint hash = id * 2654435761u;
    hash ^= hash >> 15;
    return 0.25 + 0.75 * vec3(hash & 255u, hash >> 8 & 255u, hash >> 16 & 255u) / 255.0;
}

// A heat map: from black over violet, red and yellow to white as x rises from 0 to 1.
vec3 heat_color(float x) {
    vec3 rising = clamp(vec3(3.0 * x, 3.0 * x - 1.0, 3.0 * x - 2.0), 0.0, 1.0);
    return rising + vec3(0.0, 0.0, 0.5 * max(0.0, 1.0 - abs(6.0 * x - 1.5) / 1.5));
}

// The colour of a pixel in one of the views VIEW_*; black for a pixel without a hit, except in the views of costs.
// brightest: see `FalseColor`.
vec3 false_color(PixelAovs aovs, uint view, float brightest) {
    bool is_hit = aovs.triangle_ix != NO_TRIANGLE;
    if (view == VIEW_COST) return heat_color(float(aovs.n_steps) / brightest);
    if (view == VIEW_RAYS) return heat_color(float(aovs.n_rays) / brightest);
    if (!is_hit) return vec3(0.0);
    if (view == VIEW_NORMAL) return 0.5 + 0.5 * aovs.normal_world;
    if (view == VIEW_ID) return id_color(aovs.triangle_ix);
    return vec3(1.0 / (1.0 + aovs.depth / brightest));
}

#endif
