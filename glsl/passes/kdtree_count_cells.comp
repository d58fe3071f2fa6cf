#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, count cells: counts the references of the cells' children, and the splits, the children with references and
// the references in leaves of each group of cells. One workgroup per group of cells. The last one finds how many come
// before each group, and the first group after which a capacity would be passed, if all cells before are split and all
// cells after become leaves; and it opens the next level. Reads build, sides; updates levels, cells_from, scan_blocks,
// and n_limited of build; writes n_entries, n_pairs, depth, pair_groups and entry_groups of build.
#define KD_SCAN_BLOCKS_ACCESS coherent
#include "kdtree_build/kd_sides.glsl"
#include "kdtree_build/kd_spine.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_FROM) buffer CellsFromBlock { KdCell cells_from[]; };

// The first group of cells after which a capacity would be passed, and the sums before it.
shared uint first_full;
shared uvec3 sums_before_full;
// Sizes of the children of the workgroup's cells.
shared uint child_sizes;

// Bits of a word that tells which sizes children have.
const uint SMALL = 1u;
const uint NOT_SMALL = 2u;
const uint LARGE = 4u;

uint size_of(uint n_references) {
    if (n_references == 0u) return 0u;
    if (n_references <= KD_SMALL_CELL) return SMALL;
    return n_references > KD_BIN_BLOCK ? NOT_SMALL | LARGE : NOT_SMALL;
}

// Counts the children's references. Returns the splits and, in the upper half, the children with references; the
// references in leaves; and the children's sizes.
uvec3 count(uint cell_ix) {
    KdCell cell = cells_from[cell_ix];
    if (cell.axis == KD_NO_AXIS) return uvec3(0u, cell.n_references, 0u);
    uvec2 begin = sides_before(cell.first), end = sides_before(cell.first + cell.n_references);
    uvec2 n = end - begin;
    cells_from[cell_ix].n_below = n.x;
    cells_from[cell_ix].n_above = n.y;
    cells_from[cell_ix].below_offset = begin.y;
    cells_from[cell_ix].above_offset = end.x;
    uint n_open = (n.x > 0u ? 1u : 0u) + (n.y > 0u ? 1u : 0u);
    return uvec3(1u | n_open << 16, 0u, size_of(n.x) | size_of(n.y));
}

// The references that the next level has from the cells up to one, and those of all cells after it.
uint next_and_after(uint cell_ix) {
    uint end = cells_from[cell_ix].first + cells_from[cell_ix].n_references;
    uvec2 n_sides = sides_before(end);
    return n_sides.x + n_sides.y + levels[stage.level_ix].n_references - end;
}

// Whether there is room for the children of all cells up to the end of a group.
bool has_room(KdLevel level, uvec3 sums, uint next_and_after) {
    return level.n_closed + sums.z + next_and_after <= build.max_references
        && level.n_pairs + sums.x <= build.max_pairs && sums.y <= build.max_cells;
}

// Finds the first full group of an invocation's part, and updates `before` to the sums before it. The part's end if
// there is none.
uint first_full_of(uvec2 part, inout uvec3 before) {
    KdLevel level = levels[stage.level_ix];
    for (uint i = part.x; i < part.y; ++i) {
        uvec4 sums = scan_blocks[build.cell_groups_begin + i];
        if (!has_room(level, before + sums.xyz, sums.w)) return i;
        before += sums.xyz;
    }
    return part.y;
}

void set_groups(uint next_ix, uint n_cells, uint n_references) {
    // An atomic reads what other workgroups have written.
    uint sizes = atomicOr(levels[stage.level_ix].child_sizes, 0u);
    uint n_bin_blocks = (n_references + KD_BIN_BLOCK - 1u) / KD_BIN_BLOCK;
    uint n_choose_blocks = (n_references + KD_CHOOSE_BLOCK - 1u) / KD_CHOOSE_BLOCK;
    uvec3 bins = dispatch_of((sizes & LARGE) != 0u ? n_bin_blocks : 0u);
    uvec3 choose = dispatch_of((sizes & NOT_SMALL) != 0u ? n_choose_blocks : 0u);
    uvec3 small = dispatch_of((sizes & SMALL) != 0u ? groups_over(n_references) : 0u);
    uvec3 blocks = dispatch_of(blocks_of(n_references)), references = dispatch_of(groups_over(n_references));
    uvec3 cells = dispatch_of(groups_over(n_cells));
    levels[next_ix].bin_groups_x = bins.x;
    levels[next_ix].bin_groups_y = bins.y;
    levels[next_ix].bin_groups_z = 1u;
    levels[next_ix].choose_groups_x = choose.x;
    levels[next_ix].choose_groups_y = choose.y;
    levels[next_ix].choose_groups_z = 1u;
    levels[next_ix].small_groups_x = small.x;
    levels[next_ix].small_groups_y = small.y;
    levels[next_ix].small_groups_z = 1u;
    levels[next_ix].block_groups_x = blocks.x;
    levels[next_ix].block_groups_y = blocks.y;
    levels[next_ix].block_groups_z = 1u;
    levels[next_ix].reference_groups_x = references.x;
    levels[next_ix].reference_groups_y = references.y;
    levels[next_ix].reference_groups_z = 1u;
    levels[next_ix].cell_groups_x = cells.x;
    levels[next_ix].cell_groups_y = cells.y;
    levels[next_ix].cell_groups_z = 1u;
}

// sums: splits, children with references, and references in leaves of the cells before the cutoff.
void open_next_level(uint cutoff, uvec3 sums) {
    KdLevel level = levels[stage.level_ix];
    uint next_ix = stage.level_ix + 1u;
    uint first_leaf = cutoff < level.n_cells ? cells_from[cutoff].first : level.n_references;
    uvec2 n_sides = sides_before(first_leaf);
    uint n_next = n_sides.x + n_sides.y;
    uint n_closed = level.n_closed + sums.z + level.n_references - first_leaf, n_pairs = level.n_pairs + sums.x;
    levels[stage.level_ix].cutoff = cutoff;
    levels[next_ix].n_cells = sums.y;
    levels[next_ix].n_references = n_next;
    levels[next_ix].n_closed = n_closed;
    levels[next_ix].n_pairs = n_pairs;
    set_groups(next_ix, sums.y, n_next);
    build.n_entries = n_closed;
    build.n_pairs = n_pairs;
    build.depth = sums.x > 0u ? next_ix : stage.level_ix;
    uvec3 pairs = dispatch_of(groups_over(n_pairs)), entries = dispatch_of(groups_over(n_closed));
    build.pair_groups_x = pairs.x;
    build.pair_groups_y = pairs.y;
    build.pair_groups_z = 1u;
    build.entry_groups_x = entries.x;
    build.entry_groups_y = entries.y;
    build.entry_groups_z = 1u;
}

void scan_groups(uint n_groups) {
    uvec2 part = own_part(n_groups);
    if (gl_LocalInvocationIndex == 0u) first_full = n_groups;
    uvec3 total, before = sum_before_part(build.cell_groups_begin, part, total), before_full = before;
    uint own_full = first_full_of(part, before_full);
    if (own_full < part.y) atomicMin(first_full, own_full);
    barrier();
    if (own_full < part.y && own_full == first_full) sums_before_full = before_full;
    write_prefix_sums(build.cell_groups_begin, part, before);
    barrier();
    if (gl_LocalInvocationIndex != 0u) return;
    bool is_full = first_full < n_groups;
    if (is_full) build.n_limited += total.x - sums_before_full.x;
    open_next_level(is_full ? first_full * SCAN_GROUP_SIZE : 0xffffffffu, is_full ? sums_before_full : total);
}

void main() {
    uint n_cells = levels[stage.level_ix].n_cells;
    uint begin = min(index_of_group() * SCAN_GROUP_SIZE, n_cells), end = min(begin + SCAN_GROUP_SIZE, n_cells);
    uint cell_ix = begin + scan_rank();
    if (gl_LocalInvocationIndex == 0u) child_sizes = 0u;
    barrier();
    uvec3 counts = uvec3(0u);
    uvec2 total, before;
    if (cell_ix < end) counts = count(cell_ix);
    atomicOr(child_sizes, counts.z);
    before.x = workgroup_exclusive_add(counts.x, total.x);
    before.y = workgroup_exclusive_add(counts.y, total.y);
    if (cell_ix < end) {
        uvec2 halves = halves_of(before.x);
        cells_from[cell_ix].splits_before = halves.x;
        cells_from[cell_ix].open_before = halves.y;
        cells_from[cell_ix].in_leaves_before = before.y;
    }
    if (gl_LocalInvocationIndex == 0u) is_last_group = false;
    if (gl_LocalInvocationIndex == 0u && begin < end) {
        scan_blocks[build.cell_groups_begin + index_of_group()] =
            uvec4(halves_of(total.x), total.y, next_and_after(end - 1u));
        atomicOr(levels[stage.level_ix].child_sizes, child_sizes);
        memoryBarrierBuffer();
        uint n_before = atomicAdd(levels[stage.level_ix].n_summed_groups, 1u);
        is_last_group = n_before == groups_over(n_cells) - 1u;
        memoryBarrierBuffer();
    }
    barrier();
    if (is_last_group) scan_groups(groups_over(n_cells));
}
