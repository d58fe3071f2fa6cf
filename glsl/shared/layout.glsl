// What the host and the kernels share: constants, structs and bindings, once.
//
// build.rs turns this file into src/layout.rs's contents: `#define NAME 1u` becomes a `pub const NAME: u32` (1.0: f32), a struct
// a `#[repr(C)]` one with a size assert. Members are laid out by std430 without padding: a vec3 is always followed
// by a 4-byte scalar, which fills its fourth word; whatever std430 would pad is refused by the build.
#ifndef KDRAY_LAYOUT
#define KDRAY_LAYOUT

// Invocations of a workgroup: ray kernels (one ray each), pixel kernels (8 x 8 pixels), scans.
#define RAY_GROUP_SIZE 64u
#define TILE_SIZE 8u
// Of as many lanes for one ray, one works, where a device has lanes to spare.
#define MOST_LANES_LOG2 5u
// Vulkan guarantees 128 invocations on every device.
#define SCAN_GROUP_SIZE 128u
// Triangles that kernels rasterize: pixels of a bounding rectangle that one invocation looks at alone; workgroups in
// the dispatch over the blocks that larger ones are cut into: side by side, and rows at the most.
#define RASTER_SMALL 64u
#define RASTER_GROUPS_X 256u
#define RASTER_GROUPS_Y 1024u
// Blocks of SCAN_GROUP_SIZE rays of which one invocation of the spine adds up the counts.
#define SPINE_ITEMS 8u

// A ray that hits nothing, a pixel that no triangle covers.
#define NO_TRIANGLE 0xffffffffu
// A triangle that rays pass through, in place of the index of its material.
#define TRIANGLE_HIDDEN 0x80000000u
// In place of an encoded shading normal: use the triangle's own plane. No snorm pair encodes to it.
#define FLAT_NORMAL 0x80008000u

// KdNode.axis_and_child, bits 0..1: the axis of a split, 0, 1 or 2; 0 in a leaf.
#define KD_AXIS_MASK 3u
// Bit 2: the node is a leaf.
#define KD_LEAF 4u
// Bit 3: the node has a slab, which is to be looked at first.
#define KD_HAS_SLAB 8u
// Bits 4..31: p of a split, whose children are nodes 2 p and 2 p + 1; of a leaf, how many triangles it has. With the lower
// bits cleared, a split's word is the place of its children in bytes.
#define KD_PAIR_SHIFT 4u
#define KD_NODE_BYTES 8u
// Levels below the root that the traversal's bit mask can hold: one word's, and two words'.
#define KD_WORD_DEPTH 32u
#define KD_MAX_DEPTH 64u

// Times the scene's largest coordinate: rays that start farther away are moved up to the scene first (the tree's
// rounding margin is derived for this).
#define KD_MAX_ORIGIN_DISTANCE 4.0
// Times the scene's largest coordinate: a ray that keeps this far from a triangle's plane within a leaf has no hit there.
// Twice the tree's margin: kdtree/planes.rs counts what rounding does to hits, planes and a ray's distance to a plane.
#define KD_PLANE_EPSILON 0.000015258789
// A direction's component of less magnitude is taken as this: inverse directions are finite everywhere, and rays in a split
// plane have one rule. For unit directions it is far below one rounding of a direction, 2^-24.
#define KD_LEAST_COMPONENT 1.0e-12
// Far children that the traversal `short-stack` keeps.
#define SHORT_STACK_SIZE 8u

// The most cells of a grid along an axis.
#define GRID_MAX_RESOLUTION 1024u
// The most cells along each axis into which a grid of two levels cuts a cell of the upper level.
#define GRID_MAX_BLOCK_RESOLUTION 32u

// Barycentric weights of shaded points are at least this, 2^-16: exactly on the edge of a corner of two walls, rounding may
// put a point behind the other wall, and into that wall's shadow.
#define LEAST_WEIGHT 0.000015258789
// Times the corners' weighted magnitudes: how far rays that leave a surface start from it. 2^-18, 64 roundings, covers the
// few roundings by which an interpolated point is off the plane, and those of the next ray's tests in the same plane.
#define SURFACE_CLEARANCE 0.0000038146973
// A shading normal whose interpolated square is less is no direction: the corners' normals cancel out.
#define LEAST_NORMAL_SQUARED 1.0e-12
// A reflectance below this, 2^-64, shows nowhere. A narrow highlight is darker almost all around, and is not lit there.
#define LEAST_REFLECTANCE 5.421011e-20
// The least cosine between a refracted ray and an interpolated normal, which can turn away from the viewer.
#define LEAST_COSINE 1.0e-4

// How rays find their way through the tree: the kernels' specialization constant TRAVERSAL.
#define TRAVERSAL_MASK 0u
#define TRAVERSAL_STACK 1u
#define TRAVERSAL_BRUTE 2u
#define TRAVERSAL_RESTART 3u
#define TRAVERSAL_SHORT_STACK 4u
#define TRAVERSAL_MASK_BOXES 5u
#define TRAVERSAL_BACKTRACK 6u
#define TRAVERSAL_ROPES 7u
// Triangles that brute force takes.
#define BRUTE_MAX_TRIANGLES 65000u

// How radiance becomes what a display shows: the kernel's specialization constant CURVE.
#define TONEMAP_LINEAR 0u
#define TONEMAP_AGX 1u
#define TONEMAP_ACES 2u

// Material.flags
#define MATERIAL_SPECULAR 1u
#define MATERIAL_REFLECT 2u
#define MATERIAL_REFRACT 4u
#define MATERIAL_FRESNEL 8u

// Which rays go on from a hit: child_kinds. In this order they stand in the queue.
#define CHILD_REFLECTED 1u
#define CHILD_TRANSMITTED 2u

// What light_visibility says of a ray's hit and a light: not asked for, since the light could not be seen there; lit by it;
// in the shadow of something.
#define LIGHT_UNTESTED 0u
#define LIGHT_LIT 1u
#define LIGHT_SHADOWED 2u

// A mark in place of a hit's triangle or a light's visibility, where a ray's traversal has stopped before its end: this
// bit, and below it the slot that holds the ray's state, or NO_SLOT if there was none left. Never NO_TRIANGLE.
#define STALLED 0x80000000u
#define NO_SLOT 0x7ffffffeu
// Rows of four words that a slot takes in `stalls`; one row of counts comes before the slots.
#define STALLED_RAY_ROWS 3u
// Which rays a dispatch takes: all, from their beginning; those that have stalled, from their slots; those that found no
// slot, from their beginning.
#define ROUND_BEGIN 0u
#define ROUND_RESUME 1u
#define ROUND_RESTART 2u

// Light.kind
#define LIGHT_POINT 0u
#define LIGHT_DIRECTIONAL 1u

// 48 bytes: world-space corners, counter-clockwise seen from outside; n*: octahedral 2 x snorm16 shading normals.
struct Triangle {
    vec3 v0;
    uint n0;
    vec3 v1;
    uint n1;
    vec3 v2;
    uint n2;
};

// 48 bytes: a triangle as a leaf has it, so that a ray's test waits for one load, not for an index and then a triangle. Corners as
// in Triangle; triangle_ix: its number.
struct LeafTriangle {
    vec3 v0;
    uint triangle_ix;
    vec3 v1;
    uint reserved0;
    vec3 v2;
    uint reserved1;
};

// 8 bytes. Split: split_or_first = bits of the plane's position on the axis (world units).
// Leaf: split_or_first = index of its first entry in leaf_triangles. Children of a split are neighbours at an even
// index, so a node's sibling is `index ^ 1`; the root is node 0 and node 1 is unused.
struct KdNode {
    uint split_or_first;
    uint axis_and_child;
};

// 16 bytes: the plane of a leaf's triangle, at once beside the leaf's other planes. normal: unit length, or 0 where the
// triangle has no area; a point p lies dot(normal, p) - distance above it.
struct Plane {
    vec3 normal;
    float distance;
};

// 16 bytes: between two planes, whatever of its triangles comes near a node's cell (Kay, Kajiya: Ray Tracing Complex Scenes,
// SIGGRAPH 1986). A point p lies in the slab where |dot(normal, p) - offset| <= 1: the shorter the normal, the thicker.
struct Slab {
    vec3 normal;
    float offset;
};

// 24 bytes: a node's cell, world units. Only some traversals need it.
struct KdBox {
    float min_x;
    float min_y;
    float min_z;
    float max_x;
    float max_y;
    float max_z;
};

// 8 bytes: a face of a node's cell. position: where it lies on its axis (world units); node_ix: the smallest node that has all of its
// other side, 0 where that is outside the root's cell.
struct KdRope {
    float position;
    uint node_ix;
};

// 8 bytes: a cell of a grid. At the lowest level, its triangles are the `count` entries of leaf_triangles from `first` on. At the
// upper level of two, it is cut into count x count x count cells, of which `grid_cells[first]` is the first, x fastest; a count
// of 0 means that it has no triangles.
struct GridCell {
    uint first;
    uint count;
};

// 80 bytes, named as in Wavefront MTL.
struct Material {
    vec3 ka;
    float ns;
    vec3 kd;
    float d;
    vec3 ks;
    float ni;
    vec3 ke;
    uint flags;
    vec3 tf;
    uint reserved;
};

// 32 bytes. Point: position, intensity in power per steradian (falls with the square of distance).
// Directional: unit vector towards the light, irradiance on a surface that faces it.
struct Light {
    vec3 position;
    uint kind;
    vec3 intensity;
    uint reserved;
};

// 48 bytes. direction: unit length; t in (0, t_max]; source_triangle: where the ray starts, never hit again.
struct PathRay {
    vec3 origin;
    uint pixel_ix;
    vec3 direction;
    uint source_triangle;
    vec3 throughput;
    float t_max;
};

// 32 bytes. A ray that is cast, not rendered: direction of any length, which is the unit of t; t in (t_min, t_max], any
// bounds, but those below 2^-126 may count as 0. Bounds are kept to the last bit where the origin lies within
// KD_MAX_ORIGIN_DISTANCE, elsewhere to 2^-24 of the way to the scene.
struct Ray {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

// 16 bytes. u, v: barycentric weights of v1 and v2. A miss: t = infinity, triangle_ix = NO_TRIANGLE.
struct Hit {
    float t;
    uint triangle_ix;
    float u;
    float v;
};

// The frame's constants (a uniform buffer, std140-compatible). width, height: of the window, the part of the picture
// that is rendered; it begins at the picture's pixel (window_x, window_y). sample_x, sample_y: where the frame's sample
// lies in each pixel, px from its upper left corner. Camera ray of the window's pixel (x, y):
// forward + (2 (window_x + x + sample_x) / picture_width - 1) * right
//         + (1 - 2 (window_y + y + sample_y) / picture_height) * up.
// clip_from_world is the whole picture's, moved so that the sample lies in the middle of its pixel.
// n_samples: how many samples a pixel there are with this frame's.
// n_lanes: lanes that the device has, to be shared out among fewer rays; 0: each ray gets one.
struct Frame {
    mat4 clip_from_world;
    vec3 eye;
    uint width;
    vec3 right;
    uint height;
    vec3 up;
    uint n_triangles;
    vec3 forward;
    uint n_lights;
    vec3 ambient;
    float exposure;
    vec3 background;
    float denoise_threshold;
    uint max_depth;
    uint queue_capacity;
    uint picture_width;
    uint picture_height;
    uint window_x;
    uint window_y;
    float sample_x;
    float sample_y;
    uint n_samples;
    uint n_lanes;
    uint reserved0;
    uint reserved1;
};

// One a batch and bounce, 80 bytes, sized by the bounce before: each `groups` is a VkDispatchIndirectCommand. trace and shadow
// have 2^lanes_log2 lanes for a ray, or a segment, of which the first works (bounce.rs). Those of shadow and shade are for all
// rays of the batch up to this bounce's last one.
// Rays of a batch stand in one queue, bounce after bounce: this one's are first_ray and the n_rays from there on.
// n_wanted: rays that the bounce before made; overflow: 1 where the queue has no room for them. Then n_rays is 0,
// and the batch has to be split. any_overflow: of the first row only, 1 where one of all the frame's has an overflow.
struct Bounce {
    uint first_ray;
    uint n_rays;
    uint n_wanted;
    uint overflow;
    uint trace_groups_x;
    uint trace_groups_y;
    uint trace_groups_z;
    uint trace_lanes_log2;
    uint shadow_groups_x;
    uint shadow_groups_y;
    uint shadow_groups_z;
    uint shadow_lanes_log2;
    uint scan_groups_x;
    uint scan_groups_y;
    uint scan_groups_z;
    uint any_overflow;
    uint shade_groups_x;
    uint shade_groups_y;
    uint shade_groups_z;
    uint reserved0;
};

// Counters of a bounce, of which the sum counts: as many workgroups as there are places can add to them at once. They stand so far
// apart, in counters, that they do not share a cache line.
#define COUNTER_PLACES 16u
#define COUNTER_STRIDE 16u

// COUNTER_PLACES a batch and bounce, 8 bytes: for the profile. Integer sums, the same in every order of arrival.
struct Counters {
    uint n_hits;
    uint n_shadow_rays;
};

// 64 bytes: what the primary ray of a pixel's sample hits, and what all rays of the sample cost. normal: the shading
// normal, unit length, towards the eye; albedo: Kd; depth: along the camera's view. Where nothing is hit, depth is
// infinity, both indices are NO_TRIANGLE, the vectors 0.
struct Feature {
    vec3 position_world;
    uint triangle_ix;
    vec3 normal_world;
    uint material_ix;
    vec3 albedo;
    float depth;
    // Primary, secondary and shadow rays.
    uint n_rays;
    // Of all of them: nodes read, and leaves' triangles.
    uint n_steps;
    uint reserved0;
    uint reserved1;
};

// What kernels know of the scene's triangles and acceleration structure beside the arrays (a uniform buffer).
// cell_min, cell_max: the box that holds all triangles, with the structure's rounding margin (world units).
// plane_epsilon: KD_PLANE_EPSILON in world units. n_triangles: the scene's triangles.
// For grids: the number of cells of the upper level along each axis, and the length of a cell's edge (world units). cell_min is
// the least corner of the first cell.
// Then the device address of each of the scene's arrays, low word first; 0 where kernels read the array by its binding.
struct AccelConstants {
    vec3 cell_min;
    float plane_epsilon;
    vec3 cell_max;
    uint n_triangles;
    uint n_cells_x;
    uint n_cells_y;
    uint n_cells_z;
    float cell_size;
#define ARRAY(name, element, row, number) uvec2 name;
#include "scene_arrays.glsl"
#undef ARRAY
};

// Specialization constants. Each has one number, one type and one meaning in all kernels. A kernel that uses one declares it
// as `layout(constant_id = CONSTANT_X) const TYPE X = DEFAULT;`, and Rust sets it as `constants::X`. build.rs refuses a number
// that is another constant's, or that is missing here.

// Which algorithm takes rays through the kd-tree: TRAVERSAL_MASK and its like.
#define CONSTANT_TRAVERSAL 0u
// Whether `fma` rounds once.
#define CONSTANT_FUSED_FMA 1u
// Whether hits and shadow segments are counted.
#define CONSTANT_COUNTS 2u
// Whether the nodes and triangles that a ray reads are counted.
#define CONSTANT_COUNT_COSTS 3u
// Whether the device runs both sides of a branch for all lanes, as software drivers do.
#define CONSTANT_PREDICATES_BRANCHES 4u
// Whether the rays are the camera's, which are not stored.
#define CONSTANT_FROM_CAMERA 5u
// Whether any hit answers a ray, not the closest alone.
#define CONSTANT_ANY_HIT 7u
// The curve from radiance to display: TONEMAP_LINEAR and its like.
#define CONSTANT_CURVE 8u
// Whether kernels have found the triangles that pixels show, not the graphics pipeline.
#define CONSTANT_BY_KERNELS 9u

// Whether kernels build the lower level of a grid.
#define CONSTANT_LOWER 10u
// What a scan of a grid's build adds up: GRID_SCANS_CELLS and its like. The first three are numbered as
// GRID_COUNTS_CELLS and its like are.
#define CONSTANT_SCANS 11u
#define GRID_SCANS_CELLS 0u
#define GRID_SCANS_COLUMNS 1u
#define GRID_SCANS_PAIRS 2u
#define GRID_SCANS_DIGITS 3u

// Constants that all kernels over one scene share.

// Whether rays pass through triangles with TRIANGLE_HIDDEN in `triangle_materials`.
#define CONSTANT_FILTERS 28u
// How many levels of cells the scene's grid has, 1 or 2; 0: the scene has a kd-tree.
#define CONSTANT_GRID_LEVELS 27u
// Loop turns that an invocation takes before its ray stalls; 0: any number.
#define CONSTANT_TURN_BUDGET 29u
// Words of the traversal's mask.
#define CONSTANT_MASK_WORDS 30u
// How kernels read the scene: READING_BOUND and its like.
#define CONSTANT_READING 31u
// Ways to read triangles and tree: as storage that is bound, as texels, by address.
#define READING_BOUND 0u
#define READING_TEXELS 1u
#define READING_ADDRESS 2u

// Push constants: the batch's pixels [first_pixel, first_pixel + n_pixels) in tile order, and the row of `bounces` of its bounce
// of this depth; for what lights all of its rays, depth is 0 and the row its first. round: one of ROUND_*.
struct Batch {
    uint first_pixel;
    uint n_pixels;
    uint bounce_ix;
    uint depth;
    uint round;
};

// What is displayed of features.
#define VIEW_DEPTH 1u
#define VIEW_NORMAL 2u
#define VIEW_ID 3u
#define VIEW_COST 4u
#define VIEW_RAYS 5u

// Push constants of what displays features: which of them; the value that is brightest, for cost and rays, or half as
// bright, for depth.
struct FalseColor {
    uint view;
    float brightest;
};

// Push constants of what shows a picture in a window: the sizes of both, pixels.
struct Present {
    uint width;
    uint height;
    uint window_width;
    uint window_height;
};

// 16 bytes: a triangle with a large bounding rectangle, which is cut into blocks, numbered from first_block on, row by row.
// first, size: the window's pixels, x in the lower half, y in the upper.
struct LargeTriangle {
    uint triangle_ix;
    uint first_block;
    uint first;
    uint size;
};

// 16 bytes: how many workgroups go over the blocks, a VkDispatchIndirectCommand. Behind it, in the same buffer, are 8 bytes of
// counts: large triangles in the upper half, their blocks in the lower.
struct RasterGroups {
    uint x;
    uint y;
    uint z;
    uint reserved;
};

// Push constants of what rasterizes: sides of blocks are 2^block_log2 pixels.
struct RasterPush {
    uint block_log2;
};

// Push constants of a cast: its rays, and 2^lanes_log2 lanes for each, of which the first works. round: one of ROUND_*.
struct CastBatch {
    uint n_rays;
    uint lanes_log2;
    uint round;
};

// Push constants of a cast by the driver's own ray tracing: the address of its structure.
struct DriverCast {
    uint scenery_low;
    uint scenery_high;
};

// The build of a grid (src/passes/grid).

// The most attempts to build a level of cells within the limit of references. The last one has the largest cells.
#define GRID_MAX_ATTEMPTS 4u
// The most columns as a multiple of the most references. In many columns of a long triangle's box there is no cell with
// it.
#define GRID_COLUMNS_PER_REFERENCE 4u
// Halvings after which the finest block, of GRID_MAX_BLOCK_RESOLUTION cells along each axis, is one cell.
#define GRID_MAX_HALVINGS 5u
// Counts above this are all taken as 2^32 - 1.
#define GRID_MAX_COUNT 0x7fffffffu
// Rows of SCAN_GROUP_SIZE entries, one for each invocation, that a workgroup goes through.
#define GRID_ROWS 8u
// The entries of these rows.
#define GRID_BLOCK_SIZE 1024u
// Workgroups of a dispatch side by side. More are in further rows, since a device need not take more than 65,535.
#define GRID_GROUPS_X 1024u
// Bits of the cells' indices that one pass of the sort looks at, and the number of values that they have.
#define GRID_DIGIT_BITS 4u
#define GRID_DIGITS 16u
// The most workgroups of a pass of the sort. Each sorts several blocks one after the other if there are more blocks.
#define GRID_MAX_SORT_GROUPS 1024u

// What a level's build counts next: the cells of the lower level; the columns of cells that the boxes of triangles
// take; the pairs of a cell and a triangle. Last, all is counted.
#define GRID_COUNTS_CELLS 0u
#define GRID_COUNTS_COLUMNS 1u
#define GRID_COUNTS_PAIRS 2u
#define GRID_IS_COUNTED 3u

// The state of a grid's build. The host writes it before the build and reads it afterwards.
struct GridBuild {
    // The lattice of the uniform grid or of the upper level: its box and the edge's length of a cell, world units.
    // margin: how far outside a cell a triangle still counts as inside, world units.
    vec3 cell_min;
    float cell_size;
    vec3 cell_max;
    float margin;
    uint n_cells_x;
    uint n_cells_y;
    uint n_cells_z;
    float largest_coordinate;
    // The bounds of the finite triangles, as integers of the same order (grid_bounds.comp), and the triangles' numbers.
    uint least_x;
    uint least_y;
    uint least_z;
    uint n_finite;
    uint greatest_x;
    uint greatest_y;
    uint greatest_z;
    uint n_triangles;
    // What is wanted: cells for each triangle; the most pairs, which is also the most lower cells; the most columns.
    float upper_density;
    float lower_density;
    uint max_references;
    uint max_columns;
    // What is counted. n_items: triangles at the upper level, pairs of the upper level at the lower one. n_columns,
    // n_pairs: of these items. n_upper: cells of the upper level, or of the only one. n_lower: cells of the lower
    // level. n_filled_*: those of them that have triangles.
    uint n_items;
    uint n_columns;
    uint n_pairs;
    uint n_upper;
    uint n_lower;
    uint n_filled_upper;
    uint n_filled_lower;
    // How the build goes on. n_coarser: how many times the upper level's edges were doubled. n_halvings: how many times
    // the blocks' resolutions were halved. n_attempts: failed attempts at this level. counts: GRID_COUNTS_CELLS and its
    // like.
    uint n_coarser;
    uint n_halvings;
    uint n_attempts;
    uint counts;
    // Where the sums of blocks of columns, of pairs and of upper cells begin in scan_blocks. Those of the sort begin at
    // 0.
    uint columns_begin;
    uint pairs_begin;
    uint cells_begin;
    // Blocks that a workgroup of the sort goes through.
    uint tiles_a_group;
    // Workgroups of indirect dispatches, over upper cells, items and columns, in the order in which an attempt counts.
    // Only those whose turn it is are not 0.
    uint cell_groups_x;
    uint cell_groups_y;
    uint cell_groups_z;
    uint item_groups_x;
    uint item_groups_y;
    uint item_groups_z;
    uint column_groups_x;
    uint column_groups_y;
    uint column_groups_z;
    // Workgroups over columns, pairs and upper cells, and of the sort, once all is counted.
    uint counted_column_groups_x;
    uint counted_column_groups_y;
    uint counted_column_groups_z;
    uint counted_pair_groups_x;
    uint counted_pair_groups_y;
    uint counted_pair_groups_z;
    uint counted_cell_groups_x;
    uint counted_cell_groups_y;
    uint counted_cell_groups_z;
    uint sort_groups_x;
    uint sort_groups_y;
    uint sort_groups_z;
};

// Push constants of the sort: the lowest bit of the digit that a pass sorts by.
struct GridSort {
    uint first_bit;
};

// Bindings of the frame's descriptor set. scene_arrays.glsl has those of the scene's arrays.
#define BIND_FRAME 0u
#define BIND_MATERIALS 3u
#define BIND_LIGHTS 4u
#define BIND_RAYS 8u
#define BIND_CHILD_KINDS 9u
#define BIND_FIRST_CHILDREN 10u
#define BIND_SCAN_BLOCKS 11u
#define BIND_BOUNCES 12u
#define BIND_HITS 13u
#define BIND_LIGHT_VISIBILITY 14u
#define BIND_RAY_RADIANCE 15u
#define BIND_PIXEL_RADIANCE 16u
#define BIND_PIXEL_FILTERED 17u
#define BIND_PIXEL_DISPLAY 18u
#define BIND_TRIANGLE_IDS 19u
#define BIND_COUNTERS 20u
#define BIND_PIXEL_ACCUMULATED 24u
#define BIND_PIXEL_FEATURES 25u
#define BIND_ACCEL 26u
#define BIND_PIXEL_NEAREST 28u
#define BIND_RASTER_GROUPS 29u
#define BIND_LARGE_TRIANGLES 31u
#define BIND_STALLS 32u

// The scene's arrays as texels: each at this plus its own binding. All other bindings are below it.
#define BIND_TEXELS 64u

// A cast's descriptor set has these and what the traversal reads: the scene's arrays and AccelConstants.
#define BIND_CAST_RAYS 62u
#define BIND_CAST_HITS 63u

// The descriptor set of a grid's build.
#define BIND_GRID_BUILD 40u
#define BIND_GRID_TRIANGLES 41u
#define BIND_GRID_UPPER_PAIRS 42u
#define BIND_GRID_FIRST_COLUMNS 43u
#define BIND_GRID_SCAN_BLOCKS 44u
#define BIND_GRID_PAIRS_FROM 45u
#define BIND_GRID_PAIRS_TO 46u
#define BIND_GRID_CELLS 47u
#define BIND_GRID_BLOCKS 48u
#define BIND_GRID_LEAF_TRIANGLES 49u
#define BIND_GRID_LEAF_PLANES 50u
#define BIND_GRID_FIRST_PAIRS 51u

#endif
