#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, split cells: writes the nodes of the level's cells, and the cells of their children. One workgroup per group
// of cells. The first invocation opens the next level.
// Reads build, levels, cells_from, sides, scan_blocks; writes the next of levels, cells_to, built_nodes, built_parents,
// below, and n_limited, n_entries, n_pairs, depth and entry_groups of build.
#include "kdtree_build/kd_next.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_TO) writeonly buffer CellsToBlock { KdCell cells_to[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_NODES) writeonly buffer BuiltNodesBlock { KdNode built_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_PARENTS) writeonly buffer BuiltParentsBlock { uint built_parents[]; };
layout(std430, set = 0, binding = BIND_KD_BELOW) writeonly buffer BelowBlock { uvec2 below[]; };

void set_groups(uint next_ix, uint n_cells, uint n_references, uint n_pairs) {
    uvec3 teams = dispatch_of((n_cells + KD_TEAMS - 1u) / KD_TEAMS), blocks = dispatch_of(blocks_of(n_references));
    uvec3 references = dispatch_of(groups_over(n_references)), cells = dispatch_of(groups_over(n_cells));
    uvec3 pairs = dispatch_of(groups_over(n_pairs));
    levels[next_ix].bin_groups_z = 1u;
    levels[next_ix].choose_groups_z = 1u;
    levels[next_ix].team_groups_x = teams.x;
    levels[next_ix].team_groups_y = teams.y;
    levels[next_ix].team_groups_z = 1u;
    levels[next_ix].block_groups_x = blocks.x;
    levels[next_ix].block_groups_y = blocks.y;
    levels[next_ix].block_groups_z = 1u;
    levels[next_ix].reference_groups_x = references.x;
    levels[next_ix].reference_groups_y = references.y;
    levels[next_ix].reference_groups_z = 1u;
    levels[next_ix].cell_groups_x = cells.x;
    levels[next_ix].cell_groups_y = cells.y;
    levels[next_ix].cell_groups_z = 1u;
    levels[next_ix].spine_groups_x = min(n_cells, 1u);
    levels[next_ix].spine_groups_y = 1u;
    levels[next_ix].spine_groups_z = 1u;
    levels[next_ix].pair_groups_x = pairs.x;
    levels[next_ix].pair_groups_y = pairs.y;
    levels[next_ix].pair_groups_z = 1u;
}

void open_next_level() {
    KdLevel level = levels[stage.level_ix];
    uint next_ix = stage.level_ix + 1u;
    uint n_closed = level.n_closed + level.n_in_leaves, n_pairs = level.n_pairs + level.n_splits;
    levels[next_ix].n_cells = level.n_open;
    levels[next_ix].n_references = level.n_next;
    levels[next_ix].n_closed = n_closed;
    levels[next_ix].n_pairs = n_pairs;
    levels[next_ix].n_new_pairs = level.n_splits;
    levels[next_ix].cutoff = 0xffffffffu;
    set_groups(next_ix, level.n_open, level.n_next, level.n_splits);
    build.n_entries = n_closed;
    build.n_pairs = n_pairs;
    build.depth = level.n_splits > 0u ? next_ix : stage.level_ix;
    uvec3 entries = dispatch_of(groups_over(n_closed));
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
    // All invocations that come to these lines write the same.
    uint n = levels[stage.level_ix].n_next;
    if (child.n_references > KD_SMALL_CELL) {
        uvec3 choose_groups = dispatch_of((n + KD_SMALL_CELL - 1u) / KD_SMALL_CELL);
        levels[stage.level_ix + 1u].choose_groups_x = choose_groups.x;
        levels[stage.level_ix + 1u].choose_groups_y = choose_groups.y;
    }
    if (child.n_references > KD_BIN_BLOCK) {
        uvec3 bin_groups = dispatch_of((n + KD_BIN_BLOCK - 1u) / KD_BIN_BLOCK);
        levels[stage.level_ix + 1u].bin_groups_x = bin_groups.x;
        levels[stage.level_ix + 1u].bin_groups_y = bin_groups.y;
    }
    return cell_ix + 1u;
}

void write_split(KdCell cell, uvec3 before) {
    uint pair_ix = levels[stage.level_ix].n_pairs + before.x;
    built_nodes[cell.node_ix] = KdNode(floatBitsToUint(cell.position), pair_ix << KD_PAIR_SHIFT | cell.axis);
    built_parents[pair_ix] = cell.node_ix;
    KdCell child = cell;
    child.node_ix = 2u * pair_ix;
    child.box_max[cell.axis] = cell.position;
    child.first = cell.above_offset - cell.n_below + cell.below_offset;
    child.n_references = cell.n_below;
    uint next_ix = write_child(before.y, child);
    child = cell;
    child.node_ix = 2u * pair_ix + 1u;
    child.box_min[cell.axis] = cell.position;
    child.first = cell.above_offset + cell.below_offset;
    child.n_references = cell.n_above;
    write_child(next_ix, child);
}

void main() {
    uint cell_ix = index_of_entry();
    if (cell_ix == 0u) open_next_level();
    if (cell_ix >= levels[stage.level_ix].n_cells) return;
    KdCell cell = cells_from[cell_ix];
    if (is_split(cell, cell_ix)) {
        write_split(cell, before_cell(cell, cell_ix));
        return;
    }
    write_leaf(cell.node_ix, in_leaves_before(cell, cell_ix), cell.n_references);
    if (cell.axis != KD_NO_AXIS) atomicAdd(build.n_limited, 1u);
}
