#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
// Kd-tree, choose small: finds the cheapest split of each small cell (src/accel/kdtree/sah.rs). Every plane through a
// side of a reference's bounds is tried. One workgroup per KD_TEAMS cells. A team takes one cell at a time:
// KD_TEAM_SIZE invocations, or a subgroup if that is larger.
// Reads build, levels, references_from; updates cells_from.
#include "kdtree_build/kd_splits.glsl"
#include "scan.glsl"

layout(local_size_x = SCAN_GROUP_SIZE) in;

// Of the cell of each team: the bounds of the references, and the areas on each axis.
shared vec3 least[KD_TEAMS][KD_SMALL_CELL];
shared vec3 greatest[KD_TEAMS][KD_SMALL_CELL];
shared Areas areas[KD_TEAMS][3];

struct Team {
    uint ix;
    uint size;
    uint rank; // of the invocation
};

void load(Team team, KdCell cell) {
    if (team.rank < 3u) areas[team.ix][team.rank] = areas_of(cell, team.rank);
    for (uint i = team.rank; i < cell.n_references; i += team.size) {
        least[team.ix][i] = references_from[cell.first + i].box_min;
        greatest[team.ix][i] = references_from[cell.first + i].box_max;
    }
}

// The best of the invocation's planes in a cell of n references.
uvec3 best_of_planes(Team team, uint n) {
    uvec3 best = NO_SPLIT;
    for (uint i = team.rank; i < 6u * n; i += team.size) {
        uint axis = i / (2u * n), side = i - axis * 2u * n;
        float position = side < n ? least[team.ix][side][axis] : greatest[team.ix][side - n][axis];
        Areas of_axis = areas[team.ix][axis];
        if (of_axis.slope < 0.0 || !is_inside(of_axis, position)) continue;
        uvec2 counts = uvec2(0u);
        for (uint k = 0u; k < n; ++k) {
            counts.x += least[team.ix][k][axis] < position ? 1u : 0u;
            counts.y += greatest[team.ix][k][axis] > position ? 1u : 0u;
        }
        consider(best, of_axis, axis, position, counts);
    }
    return best;
}

void main() {
    Team team;
    team.size = max(KD_TEAM_SIZE, gl_SubgroupSize);
    team.ix = scan_rank() / team.size;
    team.rank = scan_rank() % team.size;
    uint n_subgroups = team.size / gl_SubgroupSize;
    // All teams go through the loop equally often, since their number divides KD_TEAMS.
    for (uint i = team.ix; i < KD_TEAMS; i += SCAN_GROUP_SIZE / team.size) {
        uint cell_ix = index_of_group() * KD_TEAMS + i;
        bool is_cell = cell_ix < levels[stage.level_ix].n_cells;
        KdCell cell = cells_from[is_cell ? cell_ix : 0u];
        bool is_small = is_cell && cell.n_references <= KD_SMALL_CELL;
        bool is_tried = is_small && may_split(cell.n_references);
        if (is_tried) load(team, cell);
        barrier();
        uvec3 best = NO_SPLIT;
        if (is_tried) best = best_of_planes(team, cell.n_references);
        best = best_of(best, team.ix * n_subgroups, n_subgroups);
        if (team.rank == 0u && is_small) write_split(cell_ix, cell.n_references, best);
    }
}
