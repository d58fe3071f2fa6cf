#version 460
#extension GL_GOOGLE_include_directive : require
// All hits: finds the hits of each ray in (t_min, t_max], in the order of t and then of the triangles' indices, up to a
// limit for each ray. It counts them, and with LISTS_HITS writes them. There are 2^lanes_log2 invocations per ray, the
// first of which works (rays/lanes.glsl).
//
// Each hit is found by a search for the closest one behind the last one, which begins at the last one's t. All searches
// of a ray compute the same t for a triangle, so each triangle counts exactly once, in however many leaves it is.
// (Amstutz, Gribble, Guenther, Wald: An Evaluation of Multi-Hit Ray Traversal in a BVH Using Existing First-Hit/Any-Hit
// Kernels, JCGT 2015, calls that next-hit traversal, with offsets in place of the order.)
//
// In a world of instances, the hits of one instance follow those of another, since their t, which are exact in the
// instance's space alone, are rounded in the world's. The host brings them in order (src/cast/all_hits.rs).
//
// Reads cast_rays and the acceleration structure; updates hit_cursors, in which a suspended ray leaves its mark
// (search/suspended_rays.glsl); writes listed_hits.
#include "layout.glsl"

layout(push_constant) uniform CastBatchBlock { CastBatch batch; };
#define MASK_OF_CAST batch.mask

const bool COUNT_COSTS = false;
const bool TESTS_BLENDED = false;
const bool FROM_CAMERA = false;
#define NEXT_HITS
#include "search/accel.glsl"
#include "rays/cast_rays.glsl"
#include "rays/lanes.glsl"

layout(constant_id = CONSTANT_LISTS_HITS) const bool LISTS_HITS = false;

layout(local_size_x = RAY_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_CAST_RAYS) readonly buffer CastRaysBlock { Ray cast_rays[]; };
layout(std430, set = 0, binding = BIND_HIT_CURSORS) buffer HitCursorsBlock { HitCursor hit_cursors[]; };
layout(std430, set = 0, binding = BIND_LISTED_HITS) writeonly buffer ListedHitsBlock { Hit listed_hits[]; };

// The mark of a ray whose next search begins in another dispatch.
uint next_dispatch() {
    atomicAdd(suspended_counts.n_waiting, 1u);
    return SUSPENDED | NO_SLOT;
}

// Finds the hits of a valid ray that are behind the cursor. On devices that end shaders by their iterations, it finds
// one of them, so that the searches of a subgroup's rays take no more iterations than those of a cast.
void find_hits(Ray ray, inout HitCursor cursor) {
    last_hit = Nearest(cursor.t, cursor.triangle_ix);
    if (INSTANCED) next_cell = TopCell(cursor.top_node, cursor.top_pending);
    cursor.mark = NO_TRIANGLE;
    bool goes_on = cursor.next_ix < cursor.end_ix;
    while (goes_on) {
        Hit hit = traverse_any_length(bounded_ray(ray), ray.t_min, false);
        goes_on = false;
        if (is_suspended(hit.triangle_ix)) {
            cursor.mark = hit.triangle_ix;
        } else if (hit.triangle_ix != NO_TRIANGLE) {
            if (LISTS_HITS) listed_hits[cursor.next_ix] = hit;
            cursor.next_ix += 1u;
            goes_on = cursor.next_ix < cursor.end_ix;
            if (CAN_SUSPEND && goes_on) {
                cursor.mark = next_dispatch();
                goes_on = false;
            }
        }
        if (!goes_on) break;
    }
    cursor.t = last_hit.t;
    cursor.triangle_ix = last_hit.triangle_ix;
    if (INSTANCED) {
        cursor.top_node = next_cell.node_ix;
        cursor.top_pending = next_cell.pending;
    }
}

void main() {
    uint ray_ix = ray_of_lane(gl_GlobalInvocationID.x, batch.lanes_log2);
    if (ray_ix >= batch.n_rays || !runs_in_pass(batch.resume_pass, hit_cursors[ray_ix].mark)) return;
    Ray ray = cast_rays[ray_ix];
    HitCursor cursor = hit_cursors[ray_ix];
    if (is_ray(ray)) find_hits(ray, cursor);
    hit_cursors[ray_ix] = cursor;
}
