#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, split cells: writes the nodes of the level's cells, and the cells of their children. One workgroup per
// block of cells; an invocation writes one cell per row. The first invocation opens the next level.
// Reads build, levels, cells_from; writes the next of levels, cells_to, built_nodes, built_parents, below, and
// n_limited, n_entries, n_pairs, depth and entry_groups of build.
#include "kdtree_build/kd_next.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_TO) writeonly buffer CellsToBlock { KdCell cells_to[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_NODES) writeonly buffer BuiltNodesBlock { KdNode built_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_PARENTS) writeonly buffer BuiltParentsBlock { uint built_parents[]; };
layout(std430, set = 0, binding = BIND_KD_BELOW) writeonly buffer BelowBlock { uvec2 below[]; };

// Splits, open children, references of these, and references in leaves of the level.
uvec4 totals() {
    KdLevel level = levels[stage.level_ix];
    if (level.cutoff >= level.n_cells) {
        return uvec4(level.n_splits, level.n_open, level.n_below + level.n_above, level.n_in_leaves);
    }
    KdCell cell = cells_from[level.cutoff];
    uint n_before = cell.above_offset - cell.n_below + cell.below_offset;
    uint n_in_leaves = cell.in_leaves_before + level.n_references - cell.first;
    return uvec4(cell.splits_before, cell.open_before, n_before, n_in_leaves);
}

void set_groups(uint next_ix, uvec4 n) {
    uvec3 cells = groups_of(n.y), blocks = groups_of(blocks_of(n.z)), cell_blocks = groups_of(blocks_of(n.y));
    uvec3 pairs = groups_of(blocks_of(n.x));
    levels[next_ix].bin_groups_z = 1u;
    levels[next_ix].cell_groups_x = cells.x;
    levels[next_ix].cell_groups_y = cells.y;
    levels[next_ix].cell_groups_z = 1u;
    levels[next_ix].reference_groups_x = blocks.x;
    levels[next_ix].reference_groups_y = blocks.y;
    levels[next_ix].reference_groups_z = 1u;
    levels[next_ix].cell_block_groups_x = cell_blocks.x;
    levels[next_ix].cell_block_groups_y = cell_blocks.y;
    levels[next_ix].cell_block_groups_z = 1u;
    levels[next_ix].spine_groups_x = min(n.y, 1u);
    levels[next_ix].spine_groups_y = 1u;
    levels[next_ix].spine_groups_z = 1u;
    levels[next_ix].pair_groups_x = pairs.x;
    levels[next_ix].pair_groups_y = pairs.y;
    levels[next_ix].pair_groups_z = 1u;
}

void open_next_level() {
    uint next_ix = stage.level_ix + 1u;
    uvec4 n = totals();
    levels[next_ix].n_cells = n.y;
    levels[next_ix].n_references = n.z;
    levels[next_ix].n_closed = levels[stage.level_ix].n_closed + n.w;
    levels[next_ix].n_pairs = levels[stage.level_ix].n_pairs + n.x;
    levels[next_ix].n_new_pairs = n.x;
    levels[next_ix].cutoff = 0xffffffffu;
    set_groups(next_ix, n);
    build.n_entries = levels[stage.level_ix].n_closed + n.w;
    build.n_pairs = levels[stage.level_ix].n_pairs + n.x;
    build.depth = n.x > 0u ? next_ix : stage.level_ix;
    uvec3 entries = groups_of(blocks_of(build.n_entries));
    build.entry_groups_x = entries.x;
    build.entry_groups_y = entries.y;
    build.entry_groups_z = 1u;
}

void write_leaf(uint node_ix, uint first, uint n) {
    built_nodes[node_ix] = KdNode(first, n << KD_PAIR_SHIFT | KD_LEAF);
    below[node_ix] = uvec2(0u, n);
}

// Writes a child's cell, or its leaf if it has no references. Returns the index of the next child's cell.
uint write_child(uint cell_ix, KdCell child) {
    if (child.n_references == 0u) {
        write_leaf(child.node_ix, 0u, 0u);
        return cell_ix;
    }
    cells_to[cell_ix] = child;
    if (child.n_references > KD_BIN_BLOCK) {
        // All invocations that come here write the same.
        uint n = totals().z;
        uvec3 bin_groups = groups_of((n + KD_BIN_BLOCK - 1u) / KD_BIN_BLOCK);
        levels[stage.level_ix + 1u].bin_groups_x = bin_groups.x;
        levels[stage.level_ix + 1u].bin_groups_y = bin_groups.y;
    }
    return cell_ix + 1u;
}

void write_split(KdCell cell) {
    uint pair_ix = levels[stage.level_ix].n_pairs + cell.splits_before;
    built_nodes[cell.node_ix] = KdNode(floatBitsToUint(cell.position), pair_ix << KD_PAIR_SHIFT | cell.axis);
    built_parents[pair_ix] = cell.node_ix;
    KdCell child = cell;
    child.node_ix = 2u * pair_ix;
    child.box_max[cell.axis] = cell.position;
    child.first = cell.above_offset - cell.n_below + cell.below_offset;
    child.n_references = cell.n_below;
    uint next_ix = write_child(cell.open_before, child);
    child = cell;
    child.node_ix = 2u * pair_ix + 1u;
    child.box_min[cell.axis] = cell.position;
    child.first = cell.above_offset + cell.below_offset;
    child.n_references = cell.n_above;
    write_child(next_ix, child);
}

void main() {
    uint begin = index_of_group() * KD_BLOCK_SIZE + gl_LocalInvocationIndex;
    if (begin == 0u) open_next_level();
    for (uint row = 0u; row < KD_ROWS; ++row) {
        uint cell_ix = begin + row * SCAN_GROUP_SIZE;
        if (cell_ix >= levels[stage.level_ix].n_cells) break;
        KdCell cell = cells_from[cell_ix];
        if (is_split(cell, cell_ix)) {
            write_split(cell);
            continue;
        }
        uint first = levels[stage.level_ix].n_closed + in_leaves_before(cell, cell_ix);
        write_leaf(cell.node_ix, first, cell.n_references);
        if (cell.axis != KD_NO_AXIS) atomicAdd(build.n_limited, 1u);
    }
}
