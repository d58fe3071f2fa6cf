// The arrays of the scene: what kernels read of its triangles and of its acceleration structure.
//
// Each row gives an array's name, the type of an element, the type that a kernel loads at once, and the number of the array's
// binding. A kernel reads row i of an array by `load_NAME(i)`. Elements that are wider than a row take several rows.
//
// Whoever includes this file says by ARRAY what becomes of a row: layout.glsl makes members of AccelConstants, scene.glsl
// buffers and functions, and build.rs the types in Rust. A new array takes two edits: a row here, and its contents in
// src/buffers/accel.rs.

// The triangles, in the order of the scene. Three rows each: a corner, and its shading normal in the fourth word.
ARRAY(triangles, Triangle, vec4, 1u)
// One for each triangle: the index of its material; for casts with a filter, TRIANGLE_HIDDEN or 0.
ARRAY(triangle_materials, uint, uint, 2u)

// The nodes of the kd-tree.
ARRAY(kd_nodes, KdNode, uvec2, 5u)
// One for each pair of nodes: the index of their parent.
ARRAY(kd_parents, uint, uint, 6u)
// The cells of a grid: the upper level's, x fastest, then y, and behind them the blocks of the lower level, in the order of the
// upper cells.
ARRAY(grid_cells, GridCell, uvec2, 30u)

// One for each triangle of each leaf, in the order of the leaves. Three rows each: a corner, and in the first row's fourth
// word the triangle's index.
ARRAY(leaf_triangles, LeafTriangle, vec4, 7u)
// One for each of `leaf_triangles`: the plane of the triangle.
ARRAY(leaf_planes, Plane, vec4, 23u)
// One for each node, or none: the slab that holds what the node's triangles have within its cell.
ARRAY(kd_slabs, Slab, vec4, 27u)
// One for each node, or none: the cell. Three rows each. For some traversals.
ARRAY(kd_boxes, KdBox, uvec2, 21u)
// Six for each node, or none: below and above on x, y, z. For the traversal by ropes.
ARRAY(kd_ropes, KdRope, uvec2, 22u)
