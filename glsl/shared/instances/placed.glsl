// Triangles of the world. Without INSTANCED, they are those of `triangles`. With it, `triangles` has those of the
// geometries, each stored once, in its own space; a triangle of the world has the index `Instance.first_triangle` + i,
// and is computed when it is needed. Twin of src/world/instances.rs. A part of scene.glsl.
//
// `place` finds the instance of a triangle. `triangle_at` calls it, and a search does so for each instance that it
// enters. All else here is about triangles of that instance. Kernels with INSTANCED only then have the code.
//
// Needs the arrays of scene.glsl. Provides `INSTANCED`, `place`, `set_instance`, `triangle_at`, `corner_at`, `row_of`,
// `stored_corner`, `material_ix_of`, `placed_tangent`, `placement_error`, `is_mirrored`,
// `is_for_camera`, `placed` and `instance_row`.

// Kernels that find hits have modules of their own for instances (build.rs).
#ifndef TRAVERSAL
layout(constant_id = CONSTANT_INSTANCED) const bool INSTANCED = false;
#elif defined(WITH_INSTANCES)
const bool INSTANCED = true;
#else
const bool INSTANCED = false;
#endif

// The instance of the triangles that are asked for. to_row: what is added to the index of a triangle in the world to
// get its place in `triangles`.
struct Placed {
    uint instance_ix;
    uint to_row;
    uint first_material;
    uint flags;
};

Placed placed = Placed(0u, 0u, 0u, 0u);

// A row of an instance, 0 to INSTANCE_ROWS - 1.
vec4 instance_row(uint instance_ix, uint row) {
    return load_instance_rows(INSTANCE_ROWS * instance_ix + row);
}

// A word of the parts of `instance_rows` that are lists of words.
uint instance_word(uint begin, uint ix) {
    return floatBitsToUint(load_instance_rows(begin + (ix >> 2))[ix & 3u]);
}

void set_instance(uint instance_ix) {
    placed.instance_ix = instance_ix;
    uint first_triangle = floatBitsToUint(instance_row(instance_ix, 0u).w);
    placed.to_row = floatBitsToUint(instance_row(instance_ix, 5u).w) - first_triangle;
    placed.first_material = floatBitsToUint(instance_row(instance_ix, 2u).w);
    placed.flags = floatBitsToUint(instance_row(instance_ix, 4u).w);
}

bool is_mirrored() {
    return (placed.flags & INSTANCE_MIRRORED) != 0u;
}

// Whether rays of the camera meet the triangles.
bool is_for_camera() {
    if (INSTANCED) return (placed.flags & INSTANCE_FOR_CAMERA) != 0u;
    return true;
}

// Finds the instance of a triangle of the world: the last one whose first triangle does not follow it.
void place(uint triangle_ix) {
    if (INSTANCED) {
        uint low = 0u, high = accel.geometries_begin / INSTANCE_ROWS;
        while (high - low > 1u) {
            uint middle = (low + high) / 2u;
            if (instance_word(accel.instance_firsts_begin, middle) <= triangle_ix) low = middle;
            else high = middle;
        }
        set_instance(low);
    }
}

// The place of a triangle in `triangles`, and in all other arrays with an entry for each stored triangle.
uint row_of(uint triangle_ix) {
    if (INSTANCED) return triangle_ix + placed.to_row;
    return triangle_ix;
}

// The number of a corner, 0 to 2, in the stored triangle.
uint stored_corner(uint corner) {
    if (INSTANCED) return corner != 0u && is_mirrored() ? 3u - corner : corner;
    return corner;
}

uint material_ix_of(uint triangle_ix) {
    uint word = load_triangle_materials(row_of(triangle_ix));
    if (INSTANCED) return instance_word(accel.instance_materials_begin, placed.first_material + word);
    return word;
}

// A corner in the world, and its normal, by the inverse transpose of the linear map. `precise`: a corner has the same
// bits for all triangles that share it, and on all devices.
vec4 placed_corner(vec3 p, uint normal) {
    uint at = placed.instance_ix;
    precise vec3 point = p.x * instance_row(at, 0u).xyz + p.y * instance_row(at, 1u).xyz
        + p.z * instance_row(at, 2u).xyz + instance_row(at, 3u).xyz;
    uint code = FLAT_NORMAL;
    if (normal != FLAT_NORMAL) {
        vec3 n = decode_normal(normal);
        code = encode_normal(
            n.x * instance_row(at, 4u).xyz + n.y * instance_row(at, 5u).xyz + n.z * instance_row(at, 6u).xyz
        );
    }
    return vec4(point, uintBitsToFloat(code));
}

// A corner of a triangle of the world, in world space, and the code of its normal.
vec4 corner_at(uint triangle_ix, uint corner) {
    vec4 row = load_triangles(3u * row_of(triangle_ix) + stored_corner(corner));
    if (INSTANCED) return placed_corner(row.xyz, floatBitsToUint(row.w));
    return row;
}

// A triangle of the world, in world space.
Triangle triangle_at(uint triangle_ix) {
    place(triangle_ix);
    if (INSTANCED) {
        vec4 corners[3];
        for (uint i = 0u; i < 3u; ++i) corners[i] = corner_at(triangle_ix, i);
        return Triangle(
            corners[0].xyz, floatBitsToUint(corners[0].w), corners[1].xyz, floatBitsToUint(corners[1].w),
            corners[2].xyz, floatBitsToUint(corners[2].w)
        );
    }
    return stored_triangle_at(triangle_ix);
}

// The code of a corner's tangent (`CornerSurface`) in the world. A reflection changes the side of the bitangent
// (src/world/corners.rs).
uint placed_tangent(uint code) {
    if (INSTANCED) {
        if (code == FLAT_NORMAL) return code;
        uint at = placed.instance_ix;
        vec3 t = decode_normal(code & ~1u);
        t = t.x * instance_row(at, 0u).xyz + t.y * instance_row(at, 1u).xyz + t.z * instance_row(at, 2u).xyz;
        return (encode_normal(t) & ~1u) | ((code & 1u) ^ (placed.flags & INSTANCE_MIRRORED));
    }
    return code;
}

// A length whose roundings are above those of the way of a ray that leaves a point of triangle t into the geometry's
// space, and of the test of t there (world units). weights: of the corners. 0 without instances.
float placement_error(Triangle t, vec3 weights) {
    if (INSTANCED) {
        vec4 row = instance_row(placed.instance_ix, 3u);
        vec3 offset = abs(weights.x * (t.v0 - row.xyz)) + abs(weights.y * (t.v1 - row.xyz))
            + abs(weights.z * (t.v2 - row.xyz));
        return row.w * max(offset.x, max(offset.y, offset.z));
    }
    return 0.0;
}
