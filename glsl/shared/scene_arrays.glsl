// List of the scene's arrays, which hold its triangles and its acceleration structure.
//
// Each line below gives an array's name, the type of an element, the type that a kernel loads at once (a row), and
// the number of the array's binding. A kernel reads row i of an array by `load_NAME(i)`. An element that is wider
// than a row takes several rows.
//
// Needs the macro ARRAY(name, element, row, number), and provides one expansion of it for each array. layout.glsl
// turns the expansions into members of AccelConstants, scene.glsl into buffers and functions. build.rs reads this
// file itself and writes the types in Rust. A new array takes two edits: a line here, and its contents in
// src/buffers/accel.rs.

// The triangles, in the order of the scene. A triangle has three rows, one for each corner. The fourth word of a row
// is the corner's shading normal.
ARRAY(triangles, Triangle, vec4, 1u)
// One word for each triangle: the index of its material. For casts with a filter, it is TRIANGLE_HIDDEN or 0.
ARRAY(triangle_materials, uint, uint, 2u)

// Everything that textures need, as words, or none if the scene has neither textures nor colours at the corners of
// triangles (shading/texture_words.glsl).
ARRAY(texture_words, uint, uint, 31u)

// The nodes of the kd-tree, or of all geometries' kd-trees.
ARRAY(kd_nodes, KdNode, uvec2, 5u)
// One word for each pair of siblings: the index of their parent.
ARRAY(kd_parents, uint, uint, 6u)
// The cells of a grid: those of the upper level, x fastest, then y. The blocks of the lower level follow, in the
// order of the upper cells.
ARRAY(grid_cells, GridCell, uvec2, 30u)

// One entry for each triangle of each leaf, in the order of the leaves. In a grid, the cells of the lowest level take
// the place of leaves. An entry has three rows, one for each corner. The fourth word of its first row is the
// triangle's index.
ARRAY(leaf_triangles, LeafTriangle, vec4, 7u)
// One plane for each entry of `leaf_triangles`: the plane of its triangle.
ARRAY(leaf_planes, Plane, vec4, 23u)
// One slab for each node, or no slabs at all. A slab holds the parts of the node's triangles that come near the
// node's cell. The entries of nodes without KD_HAS_SLAB are unused.
ARRAY(kd_slabs, Slab, vec4, 27u)
// What some traversals read beside the tree, or nothing. The traversal by ropes has six ropes for each node, one for
// each face of its cell, in the order -x, +x, -y, +y, -z, +z. Those that need the cells of nodes have a `KdBox` for
// each node, in three rows.
ARRAY(kd_links, KdRope, uvec2, 22u)

// The instances, the constants of their geometries, the hierarchy over the instances, the first triangle of each
// instance, and the materials of the instances' slots (instances/placed.glsl). Empty if the world has no instances.
ARRAY(instance_rows, InstanceRow, vec4, 39u)
