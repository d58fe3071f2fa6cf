// The search through a grid, from cell to cell along the ray: a 3D digital differential analyzer (Amanatides and Woo,
// "A fast voxel traversal algorithm for ray tracing", 1987; on GPUs first Purcell, Buck, Mark and Hanrahan, "Ray
// tracing on programmable graphics hardware", SIGGRAPH 2002). In a grid of two levels, each cell of the upper level
// that has triangles is cut into a block of lower cells, which the ray traverses. A part of search/accel.glsl, which
// calls `search_grid`.
//
// `cube` means the three indices of a cell in its lattice (lattice.glsl). All t are half of the ray's own
// (search/traversal_ray.glsl).
//
// The t at which the ray meets a plane between cells is computed from the plane itself, not summed up from cell to
// cell. So the kd-tree's proof holds: rounding moves the ray by no more than the margin, and a cell has all triangles
// that come within the margin (src/accel/bounds.rs).

#include "constants.glsl"
#include "grid/lattice.glsl"

// The number of levels of cells in the scene's grid, 1 or 2. It is 0 if the scene has a kd-tree.
layout(constant_id = CONSTANT_GRID_LEVELS) const uint GRID_LEVELS = 0u;

// The value of GridWalk.upper_cube, in place of a packed cube, if the ray is in the upper level itself.
const uint IN_UPPER_LEVEL = 0xffffffffu;
// The largest finite number. t_exit is at most this, so that exits at borders, which may be infinite, come later.
const float LARGEST_T = 3.4028235e38;

// How many cells, or triangles' planes, an invocation tests in one iteration of the search. Lanes that search for cells
// wait for lanes of their subgroup that search for triangles, and the reverse, so each search is limited. Measured on
// an H200 with rays of a dragon in a room: the limit of 4 cells makes the search 1.2 to 2 times as fast as no limit.
// The limit of 4 triangles makes it 1.1 to 1.6 times as fast in uniform grids, whose cells have many triangles. In
// grids of two levels it would cost 5 %, so there it does not apply.
const uint CELLS_PER_ITERATION = 4u;
const uint TRIANGLES_PER_ITERATION = 4u;

// A ray's position on its way through the cells of one lattice. first_cell: the index of the lattice's first cell in
// grid_cells. upper_cube: the packed cube of the upper level that this lattice is the block of, or IN_UPPER_LEVEL.
// cube: the cube that the ray is in. t_next: the t at which the ray leaves this cube on each axis. t_enter: the t at
// which it enters the cube. t_exit: the t at which it leaves the lattice.
struct GridWalk {
    Lattice lattice;
    uint first_cell;
    uint upper_cube;
    uvec3 cube;
    vec3 t_next;
    float t_enter;
    float t_exit;
};

// The grid of the geometry that is searched, with INSTANCED: the lattice of its upper level, and its first cell.
Lattice entered_lattice;
uint entered_cell;

// The lattice of the uniform grid, or of the upper level.
Lattice upper_lattice() {
    if (INSTANCED) return entered_lattice;
    uvec3 n_cells = uvec3(accel.n_cells_x, accel.n_cells_y, accel.n_cells_z);
    return Lattice(accel.box_min, accel.cell_size, accel.box_max, n_cells);
}

// The index of the upper level's first cell in grid_cells.
uint upper_cell() {
    if (INSTANCED) return entered_cell;
    return 0u;
}

// Packs a cube's indices, which are below GRID_MAX_RESOLUTION, into 10 bits each.
uint pack_cube(uvec3 cube) {
    return cube.x | (cube.y << 10) | (cube.z << 20);
}

uvec3 unpack_cube(uint packed) {
    return uvec3(packed, packed >> 10, packed >> 20) & (GRID_MAX_RESOLUTION - 1u);
}

// The t at which the ray leaves cubes of these indices on each axis. The planes are those of `planes_of`, except at
// the lattice's border. There, t_exit ends the search of the lattice, since it is no later than the border's t. In a
// uniform grid, the border's plane is where the last cubes end. The box may cut these cubes, so the ray leaves the
// box first. In a grid of two levels, a block's border may be off by rounding, so the t of every border is infinity.
vec3 exits_of(Lattice lattice, TraversalRay ray, uvec3 cube) {
    uvec3 faces = cube + uvec3(greaterThanEqual(ray.inv_direction, vec3(0.0)));
    precise vec3 offsets = vec3(faces) * lattice.cell_size;
    precise vec3 planes = lattice.least + offsets;
    precise vec3 t = fma(planes, ray.inv_direction, ray.bias);
    if (GRID_LEVELS == 1u) return t;
    bvec3 are_inner = lessThan(faces - 1u, lattice.n_cells - 1u); // a face of 0 wraps around
    return mix(vec3(INFINITY), t, are_inner);
}

// The ray's step on each axis: +1 if the direction's component is positive or almost 0, else -1.
ivec3 steps_of(TraversalRay ray) {
    return 2 * ivec3(greaterThanEqual(ray.inv_direction, vec3(0.0))) - 1;
}

// Enters the lattice at t_enter: finds the first cube on the ray's way that the ray leaves at t_enter or later. A
// first estimate is computed from the point at t_enter. Its indices are off by about 1, which the loop corrects. On
// axes on which the ray leaves the cube earlier than t_enter (are_late), it goes forward. On axes on which the ray
// leaves the previous cube at t_enter or later (are_early), it goes back.
void enter_lattice(TraversalRay ray, inout GridWalk walk) {
    ivec3 steps = steps_of(ray);
    ivec3 cube = ivec3(cube_near(walk.lattice, ray.shear.origin + 2.0 * walk.t_enter * ray.direction));
    ivec3 last = ivec3(walk.lattice.n_cells) - 1;
    bool moves = true;
    while (moves) {
        count_iteration();
        ivec3 before = clamp(cube - steps, ivec3(0), last);
        bvec3 are_late = lessThan(exits_of(walk.lattice, ray, uvec3(cube)), vec3(walk.t_enter));
        bvec3 are_early = greaterThanEqual(exits_of(walk.lattice, ray, uvec3(before)), vec3(walk.t_enter));
        ivec3 next = clamp(cube + steps * (ivec3(are_late) - ivec3(are_early)), ivec3(0), last);
        moves = any(notEqual(next, cube));
        cube = next;
        if (!moves) break;
    }
    walk.cube = uvec3(cube);
    walk.t_next = exits_of(walk.lattice, ray, walk.cube);
}

// Enters the upper level where the ray enters the box that holds all triangles.
GridWalk enter_grid(TraversalRay ray) {
    GridWalk walk;
    walk.lattice = upper_lattice();
    walk.first_cell = upper_cell();
    walk.upper_cube = IN_UPPER_LEVEL;
    walk.t_enter = ray.t_enter;
    walk.t_exit = min(ray.t_exit, LARGEST_T);
    enter_lattice(ray, walk);
    return walk;
}

// The least component.
float least_of(vec3 v) {
    return min(v.x, min(v.y, v.z));
}

// The t at which the ray leaves its cube, or the lattice if that is earlier.
float t_leave_of(GridWalk walk) {
    return min(least_of(walk.t_next), walk.t_exit);
}

// Goes from a cube of the upper level into the block of cells that it is cut into.
void enter_block(TraversalRay ray, GridCell block, inout GridWalk walk) {
    walk.t_exit = t_leave_of(walk);
    walk.upper_cube = pack_cube(walk.cube);
    walk.lattice = lattice_within(walk.lattice, walk.cube, block.count);
    walk.first_cell = block.first;
    enter_lattice(ray, walk);
}

// Goes back to the cube of the upper level whose block the ray is in.
void leave_block(TraversalRay ray, inout GridWalk walk) {
    walk.lattice = upper_lattice();
    walk.first_cell = upper_cell();
    walk.cube = unpack_cube(walk.upper_cube);
    walk.upper_cube = IN_UPPER_LEVEL;
    walk.t_next = exits_of(walk.lattice, ray, walk.cube);
    walk.t_exit = min(ray.t_exit, LARGEST_T);
}

// Loads the cell that the ray is in.
GridCell cell_of(GridWalk walk) {
    count_steps(1u);
    uvec2 words = load_grid_cells(walk.first_cell + cell_ix_of(walk.lattice, walk.cube));
    return GridCell(words.x, words.y);
}

// Returns the entries of the cell that the ray is in, and the ray's segment there. If this is an upper cell with a
// block, enters the block and returns those of the lower cell that the ray enters first.
Visit visit_cell(TraversalRay ray, float t_best, inout GridWalk walk) {
    GridCell cell = cell_of(walk);
    if (GRID_LEVELS == 2u && walk.upper_cube == IN_UPPER_LEVEL && cell.count > 0u) {
        enter_block(ray, cell, walk);
        cell = cell_of(walk);
    }
    count_steps(cell.count);
    return Visit(cell.first, cell.first + cell.count, interval_of(walk.t_enter, min(t_leave_of(walk), t_best)));
}

// Goes to the ray's next cube. At the end of a block, this is the upper level's next cube. Returns false if nothing
// nearer than t_best can follow.
bool step_on(TraversalRay ray, float t_best, inout GridWalk walk) {
    float t = least_of(walk.t_next);
    if (GRID_LEVELS == 2u && walk.upper_cube != IN_UPPER_LEVEL && !(t < walk.t_exit)) {
        leave_block(ray, walk);
        t = least_of(walk.t_next);
    }
    if (!(t < walk.t_exit) || t_best < t) return false;
    bool is_x = walk.t_next.x == t;
    bool is_y = !is_x && walk.t_next.y == t;
    ivec3 steps = steps_of(ray) * ivec3(is_x, is_y, !is_x && !is_y);
    walk.cube = uvec3(ivec3(walk.cube) + steps);
    walk.t_next = exits_of(walk.lattice, ray, walk.cube);
    walk.t_enter = t;
    return true;
}

// Goes to the next cell that has triangles, but no farther than CELLS_PER_ITERATION cells. Returns false if nothing
// nearer than t_best can follow.
bool find_cell(TraversalRay ray, float t_best, inout GridWalk walk, inout Visit visit) {
    bool goes_on = true;
    bool seeks = true;
    uint n_left = CELLS_PER_ITERATION;
    while (seeks) {
        count_iteration();
        goes_on = step_on(ray, t_best, walk);
        if (goes_on) visit = visit_cell(ray, t_best, walk);
        n_left -= 1u;
        seeks = goes_on && visit.entry_ix >= visit.end_ix && n_left > 0u && has_iterations();
        if (!seeks) break;
    }
    return goes_on;
}

// Finds the cell's next triangle whose plane the ray meets within the cell. In uniform grids it tests at most
// TRIANGLES_PER_ITERATION planes.
bool find_candidate_soon(TraversalRay ray, inout Visit visit, out uint entry_ix) {
    if (GRID_LEVELS == 2u) return find_candidate(ray, visit, entry_ix);
    uint end_ix = visit.end_ix;
    visit.end_ix = min(end_ix, visit.entry_ix + TRIANGLES_PER_ITERATION);
    bool found = find_candidate(ray, visit, entry_ix);
    visit.end_ix = end_ix;
    return found;
}

// Stores the ray's state, and returns the mark that takes the place of its result (search/suspended_rays.glsl).
uint suspend_in_grid(GridWalk walk, Visit visit, Nearest best) {
    vec2 weights = spilled_pair(WEIGHTS_SLOT);
    return suspend(SuspendedRay(
        pack_cube(walk.cube), walk.t_enter, 0.0, visit.entry_ix, visit.end_ix,
        best.t, best.triangle_ix, weights.x, weights.y, steps_so_far(), uvec2(walk.upper_cube, 0u),
        outer.top_node, outer.top_pending, outer.t, outer.triangle_ix
    ));
}

// Loads the ray's stored state. The t of planes are computed by the same operations as in the first search, so they
// have the same bits. The visit ends at the nearest hit so far, which can be nearer than when the visit began.
void resume_in_grid(TraversalRay ray, out GridWalk walk, out Visit visit, out Nearest best) {
    SuspendedRay state = suspended_rays[resumed_slot];
    walk.lattice = upper_lattice();
    walk.first_cell = upper_cell();
    walk.upper_cube = IN_UPPER_LEVEL;
    walk.t_exit = min(ray.t_exit, LARGEST_T);
    if (state.siblings_done.x != IN_UPPER_LEVEL) {
        walk.upper_cube = state.siblings_done.x;
        uvec3 upper = unpack_cube(walk.upper_cube);
        uvec2 block = load_grid_cells(walk.first_cell + cell_ix_of(walk.lattice, upper));
        walk.t_exit = min(least_of(exits_of(walk.lattice, ray, upper)), walk.t_exit);
        walk.lattice = lattice_within(walk.lattice, upper, block.y);
        walk.first_cell = block.x;
    }
    walk.cube = unpack_cube(state.node_offset);
    walk.t_next = exits_of(walk.lattice, ray, walk.cube);
    walk.t_enter = state.t_enter;
    best = Nearest(state.t_best, state.triangle_ix);
    spill_pair(WEIGHTS_SLOT, state.u, state.v);
    visit = Visit(state.entry_ix, state.end_ix, interval_of(walk.t_enter, min(t_leave_of(walk), best.t)));
    count_steps(state.n_steps);
    resumes = false;
}

// Searches all cells that the ray meets in [t_enter, t_exit], until nothing nearer can follow. Each iteration of the
// loop tests at most one triangle. If the cell has no triangles left, the iteration goes on towards the next cell that
// has triangles, by at most CELLS_PER_ITERATION cells. Returns 0, or the mark of a suspended ray.
uint search_grid(TraversalRay ray, bool any_hit, inout Nearest best) {
    if (!is_in(ray)) return 0u;
    GridWalk walk;
    Visit visit;
    if (is_resumed()) {
        resume_in_grid(ray, walk, visit, best);
    } else {
        walk = enter_grid(ray);
        visit = visit_cell(ray, best.t, walk);
    }
    uint mark = 0u;
    bool goes_on = true;
    while (goes_on) {
        count_iteration();
        uint entry_ix;
        if (find_candidate_soon(ray, visit, entry_ix)) {
            LeafTriangle entry = leaf_triangle_at(entry_ix);
            intersect(ray, corners_of(entry), entry.triangle_ix, best);
            goes_on = !is_done(any_hit, best);
        } else if (visit.entry_ix >= visit.end_ix && has_iterations()) {
            goes_on = find_cell(ray, best.t, walk, visit);
        }
        if (goes_on && !has_iterations()) {
            mark = suspend_in_grid(walk, visit, best);
            goes_on = false;
        }
        if (!goes_on) break;
    }
    return mark;
}
