// Surface area heuristic. Twin of src/accel/kdtree/sah.rs. Lengths are divided by 4, so that none overflows.
#ifndef KDRAY_KD_AREAS
#define KDRAY_KD_AREAS

#include "kdtree_build/kd_build.glsl"

// The least and the greatest extent on an axis at which a cell is split on that axis, divided by 4: 2^-117, and a
// quarter of the largest float.
const float LEAST_QUARTER = 6.0185311e-36;
const float GREATEST_QUARTER = 8.5070587e37;

// Shares of the parts below and above a plane of a cell's surface area: base + slope * fraction of the extent.
struct Areas {
    float least;
    float greatest;
    float quarter; // of the extent
    float per_quarter;
    float base;
    float slope; // below 0: no plane can split the cell on this axis
};

Areas areas_of(KdCell cell, uint axis) {
    precise vec3 quarters = 0.25 * cell.box_max - 0.25 * cell.box_min;
    float longest = max(quarters.x, max(quarters.y, quarters.z));
    float along = quarters[axis];
    if (!(along >= LEAST_QUARTER && along <= GREATEST_QUARTER)) return Areas(0.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    precise vec3 sides = quarters / longest;
    float side = sides[axis], u = sides[(axis + 1u) % 3u], v = sides[(axis + 2u) % 3u];
    precise float half_area = side * u + side * v + u * v;
    if (!(half_area > 0.0)) return Areas(0.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    precise float base = u * v / half_area;
    precise float slope = side * (u + v) / half_area;
    return Areas(cell.box_min[axis], cell.box_max[axis], along, 1.0 / along, base, slope);
}

// A position as a fraction of the extent.
float fraction_of(Areas areas, float position) {
    precise float fraction = (0.25 * position - 0.25 * areas.least) * areas.per_quarter;
    return fraction;
}

// The weight of a split at a position, with n_below and n_above references on its sides.
float weight_of(Areas areas, float position, uint n_below, uint n_above) {
    float fraction = fraction_of(areas, position);
    precise float below = areas.base + areas.slope * fraction;
    precise float above = areas.base + areas.slope * (1.0 - fraction);
    precise float weight = below * float(n_below) + above * float(n_above);
    precise float with_bonus = weight * build.empty_factor;
    return n_below == 0u || n_above == 0u ? with_bonus : weight;
}

#endif
