#version 460
#extension GL_GOOGLE_include_directive : require
// Kd-tree, split cells: writes the nodes of the level's cells, and the cells of their children. One workgroup per group
// of cells.
// Reads build, levels, cells_from, sides, scan_blocks; writes cells_to, built_nodes, built_parents, below, places.
#include "kdtree_build/kd_next.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;
layout(std430, set = 0, binding = BIND_KD_CELLS_TO) writeonly buffer CellsToBlock { KdCell cells_to[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_NODES) writeonly buffer BuiltNodesBlock { KdNode built_nodes[]; };
layout(std430, set = 0, binding = BIND_KD_BUILT_PARENTS) writeonly buffer BuiltParentsBlock { uint built_parents[]; };
layout(std430, set = 0, binding = BIND_KD_BELOW) writeonly buffer BelowBlock { uvec2 below[]; };
layout(std430, set = 0, binding = BIND_KD_PLACES) writeonly buffer PlacesBlock { uvec2 places[]; };

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
    cells_to[cell_ix].box_min = child.box_min;
    cells_to[cell_ix].first = child.first;
    cells_to[cell_ix].box_max = child.box_max;
    cells_to[cell_ix].n_references = child.n_references;
    cells_to[cell_ix].node_ix = child.node_ix;
    return cell_ix + 1u;
}

void write_split(KdCell cell, uvec3 before) {
    uint pair_ix = levels[stage.level_ix].n_pairs + before.x;
    built_nodes[cell.node_ix] = KdNode(floatBitsToUint(cell.position), pair_ix << KD_PAIR_SHIFT | cell.axis);
    built_parents[pair_ix] = cell.node_ix;
    places[2u * pair_ix] = uvec2(0u);
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
    if (cell_ix >= levels[stage.level_ix].n_cells) return;
    KdCell cell = cells_from[cell_ix];
    if (is_split(cell, cell_ix)) write_split(cell, before_cell(cell, cell_ix));
    else write_leaf(cell.node_ix, in_leaves_before(cell, cell_ix), cell.n_references);
}
