// The constants, structs and bindings that the host and the kernels share, defined once.
//
// build.rs translates this file into the contents of src/layout.rs. `#define NAME 1u` becomes a `pub const NAME: u32`
// (1.0: f32), and a struct becomes a `#[repr(C)]` struct whose size is asserted. The comment above a constant or a
// struct becomes its documentation. Members are laid out by std430 without padding: a vec3 is always followed by a
// 4-byte scalar, which fills its fourth word. The build refuses a member that std430 would pad.
#ifndef KDRAY_LAYOUT
#define KDRAY_LAYOUT

// Invocations of a workgroup in ray kernels. An invocation handles one ray, or none (`MOST_LANES_LOG2`).
#define RAY_GROUP_SIZE 64u
// Side of the square of pixels that a workgroup of a pixel kernel handles. It is also the side of the squares in whose
// order pixels are rendered.
#define PIXEL_GROUP_SIZE 8u
// Base-2 logarithm of the most lanes that one ray gets. If a dispatch has fewer rays than the device has lanes, each
// ray gets several lanes, a power of two. Only the first of them works, so that fewer divergent rays share a
// subgroup.
#define MOST_LANES_LOG2 5u
// Invocations of a workgroup in prefix sums. Vulkan guarantees 128 invocations on every device.
#define SCAN_GROUP_SIZE 128u
// The most pixels in the bounding rectangle of a small triangle. A workgroup of `rasterize_triangles.comp` shares the
// pixels of its small triangles among its invocations. The rectangles of larger triangles are cut into blocks.
#define RASTER_SMALL 64u
// Workgroups side by side in the dispatch over the blocks of large triangles (`rasterize_blocks.comp`).
#define RASTER_GROUPS_X 256u
// The most rows of workgroups in that dispatch.
#define RASTER_GROUPS_Y 1024u
// Counts that one invocation of `compact_spine.comp` loads and adds up in each turn of its loop. Each is the count of
// a block of `SCAN_GROUP_SIZE` rays.
#define SPINE_ITEMS 8u
// Upper bound of the invocations of its only workgroup. On a GPU, the workgroup has the largest power of two that the
// device allows, up to this bound. On a software driver, it has `SCAN_GROUP_SIZE`.
#define SPINE_MOST_INVOCATIONS 1024u

// Triangle index of a ray that hits nothing, and of a pixel that no triangle covers.
#define NO_TRIANGLE 0xffffffffu
// Marks a triangle that rays pass through. It replaces the index of the triangle's material.
#define TRIANGLE_HIDDEN 0x80000000u
// Replaces the encoded shading normal of a corner that has none. Kernels then shade with the normal of the triangle's
// plane. No encoded normal equals this value.
#define FLAT_NORMAL 0x80008000u

// `KdNode.axis_and_child`, bits 0..1: the axis of a split, 0, 1 or 2. The bits are 0 in a leaf.
#define KD_AXIS_MASK 3u
// `KdNode.axis_and_child`, bit 2: the node is a leaf.
#define KD_LEAF 4u
// `KdNode.axis_and_child`, bit 3: the node, a split or a leaf, has a slab. The slab is tested before the split's
// children or the leaf's triangles.
#define KD_HAS_SLAB 8u
// `KdNode.axis_and_child`, bits 4..31. In a split, they are a number p: the split's children are nodes 2 p and
// 2 p + 1. In a leaf, they are the number of its triangles. With the lower bits cleared, a split's word is the offset
// of its children in bytes.
#define KD_PAIR_SHIFT 4u
// Size of a `KdNode`.
#define KD_NODE_BYTES 8u
// The most levels below the root that one word of the traversal's bit mask can hold.
#define KD_WORD_DEPTH 32u
// The most levels below the root that two words of the traversal's bit mask can hold.
#define KD_MAX_DEPTH 64u

// The greatest magnitude of a coordinate of a ray's origin, as a multiple of the scene's largest coordinate. A ray
// that starts farther away is first moved along itself up to the scene. The rounding margins of triangles are derived
// for this limit.
#define KD_MAX_ORIGIN_DISTANCE 4.0
// If a ray keeps this far from a triangle's plane all along its way through a leaf, it has no hit on the triangle in
// this leaf. At scale 0 (scales.rs), it is a multiple of the scene's largest coordinate, and twice the margin.
// src/accel/kdtree/planes.rs adds up what rounding does to hits, to planes and to a ray's distance from a plane.
#define KD_PLANE_EPSILON 0.000015258789
// A component of a direction is replaced by this if its magnitude is less. So inverse directions are finite, and rays
// that are parallel to a split plane need no case of their own. For unit directions, the change is far below the
// rounding of a component, 2^-24.
#define KD_LEAST_COMPONENT 1.0e-12
// Far children that the traversal `short-stack` keeps.
#define SHORT_STACK_SIZE 8u

// The most cells of a grid along an axis.
#define GRID_MAX_RESOLUTION 1024u
// The most cells along each axis into which a grid of two levels cuts a cell of the upper level.
#define GRID_MAX_BLOCK_RESOLUTION 32u

// Lower bound of the barycentric weights of shaded points, 2^-16. It keeps points off edges. At an edge between two
// walls, rounding could otherwise put a point of one wall behind the other wall, into that wall's shadow.
#define LEAST_WEIGHT 0.000015258789
// Distance from a surface at which rays that leave it start, as a multiple of `dot(m, abs(normal))`. m is the mean of
// the corners' absolute coordinates, weighted by the hit's barycentric weights. The factor is 2^-18, which is 64
// roundings. It covers the few roundings by which an interpolated point is off the plane, and the rounding in the
// tests of the next ray against triangles in the same plane.
#define ORIGIN_OFFSET 0.0000038146973
// Lower bound of the number that ORIGIN_OFFSET multiplies, as a share of the largest component of m. Triangles in a
// plane such as y = 0 need it: `dot(m, abs(normal))` is 0 there, but the tests of the next ray against triangles in the
// same plane round as the other two coordinates do. The distance is then 16 roundings of the largest coordinate.
#define LEAST_ORIGIN_OFFSET_SHARE 0.25
// Squared length below which an interpolated shading normal has no direction: the corners' normals cancel out.
#define LEAST_NORMAL_SQUARED 1.0e-12
// Reflectance, 2^-64, below which light is never visible. Outside its small bright spot, a narrow highlight reflects
// less than this. Hits that reflect no more of a light trace no shadow ray to it.
#define LEAST_REFLECTANCE 5.421011e-20
// Throughput below which the children of a ray at a surface of microfacets are dropped. Such a surface reflects a
// little at each hit, so the number of rays would double from bounce to bounce.
#define LEAST_THROUGHPUT 0.0009765625
// Lower bound of the cosine between an interpolated normal and the direction to the ray's origin. The bound is needed
// because an interpolated normal can point away from the viewer.
#define LEAST_COSINE 1.0e-4

// Cosine of the angle between a light and the normal of a triangle's plane, up to which rays to the light start at the
// curved surface that the corners' normals suggest (`lit_point`).
#define CURVED_START_COSINE 0.1
// The cosine from which on these rays start at the triangle itself. In between, the start moves linearly.
#define PLANE_START_COSINE 0.2

// The most triangles that brute force accepts.
#define BRUTE_MAX_TRIANGLES 65000u

// Values of the specialization constant `CURVE`: how radiance is mapped to the range of a display.
#define TONEMAP_LINEAR 0u
#define TONEMAP_AGX 1u
#define TONEMAP_ACES 2u
#define TONEMAP_NEUTRAL 3u

// `Material.flags`: the material has a Phong highlight.
#define MATERIAL_SPECULAR 1u
// `Material.flags`: the material reflects rays as a mirror does.
#define MATERIAL_REFLECT 2u
// `Material.flags`: the material refracts rays.
#define MATERIAL_REFRACT 4u
// `Material.flags`: the share of reflected light follows Fresnel's equations.
#define MATERIAL_FRESNEL 8u
// `Material.flags`: the material reflects by microfacets (shading/microfacet.glsl), not by Phong's model.
#define MATERIAL_MICROFACET 16u
// `Material.flags`, with microfacets: the surface is the boundary of a solid, which refracts and absorbs light. Without
// this flag it is a thin sheet.
#define MATERIAL_SOLID 32u
// `Material.flags`: the surface shows `kd` and `ke` without any light.
#define MATERIAL_UNLIT 64u
// `Material.flags`: the path tracer adds no light that bounces between microfacets more than once.
#define MATERIAL_SINGLE_SCATTERING 128u
// `Material.flags`: for the path tracer, the metal has the complex index of refraction `conductor_eta` +
// i `conductor_k`. Without this flag, its reflectance follows from the base colour.
#define MATERIAL_CONDUCTOR 256u
// `Material.flags`: for the path tracer, the width of the distribution of microfacets' normals follows from Phong's
// exponent `ns`, not from `roughness`.
#define MATERIAL_PHONG_WIDTH 512u
// `Material.flags`: camera rays pass through the back faces of the surface (shading/back_faces.glsl).
#define MATERIAL_SINGLE_SIDED 1024u

// Roughness up to which a microfacet surface reflects rays as a mirror does.
#define MIRROR_ROUGHNESS 0.1
// Roughness from which a microfacet surface reflects no rays. In between, the share of mirrored light falls linearly.
#define DIFFUSE_ROUGHNESS 0.3
// Lower bound of the width of a distribution of microfacets, the squared roughness. It keeps highlights of point lights
// finite.
#define LEAST_MICROFACET_WIDTH 0.002
// Width of a distribution of microfacets below which the path tracer takes a surface for perfectly smooth. It is that
// of the roughness 0.03.
#define LEAST_ROUGH_WIDTH 0.001
// Relative difference of two indices of refraction below which the path tracer takes them for equal. The light that
// passes is then not bent. Otherwise, rounding would blur the microfacet that bends a direction into another one.
#define LEAST_INDEX_STEP 0.01
// Lower bound of the roughness of sheen. Below, sheen would be a line at the horizon.
#define LEAST_SHEEN_ROUGHNESS 0.25
// Opacity below which light passes through a blended surface on its way to another hit. A shadow ray cannot be
// weakened, only stopped.
#define LEAST_SHADOWING_OPACITY 0.5
// Opacity below which a blended surface is not there: less than half a step of 8 bits.
#define LEAST_SEEN_OPACITY 0.00195

// Takes the place of an index in `textures` where a material has no texture.
#define NO_TEXTURE 0xffffffffu
// Words at the beginning of `texels`: for each byte that encodes a colour by sRGB, the bits of its linear value as a
// float.
#define SRGB_TABLE_SIZE 256u
// `Texture.flags`, bits 0..1: what the texture shows outside of 0 to 1 along u, `WRAP_REPEAT` and its like.
#define TEXTURE_WRAP_U_SHIFT 0u
// `Texture.flags`, bits 2..3: what the texture shows outside of 0 to 1 along v.
#define TEXTURE_WRAP_V_SHIFT 2u
// The bits of one direction's wrap, once they are shifted down.
#define TEXTURE_WRAP_MASK 3u
// The image repeats.
#define WRAP_REPEAT 0u
// The image repeats, and every second copy is mirrored.
#define WRAP_MIRROR 1u
// The texels of the border continue.
#define WRAP_CLAMP 2u
// `Texture.flags`: the texture uses the second set of texture coordinates.
#define TEXTURE_UV_SET 16u
// `Texture.flags`: the bytes of the colours are encoded by sRGB. Textures with `TEXTURE_HALVES` are always linear.
#define TEXTURE_SRGB 32u
// `Texture.flags`: a texel has two words, each of which packs two half-precision floats: first red (in the lower bits)
// and green, then blue and opacity. Without the flag, a texel is one word of four bytes, red in the lowest one.
#define TEXTURE_HALVES 64u
// `Texture.flags`: the texture shows squares of one colour, not blends of neighbouring texels.
#define TEXTURE_NEAREST 128u
// `Texture.flags`, bits 8..10: the channel that a texture of one number reads, `CHANNEL_RED` and its like.
#define TEXTURE_CHANNEL_SHIFT 8u
// The bits of the channel, once they are shifted down.
#define TEXTURE_CHANNEL_MASK 7u
// Values of the channel.
#define CHANNEL_RED 0u
#define CHANNEL_GREEN 1u
#define CHANNEL_BLUE 2u
#define CHANNEL_ALPHA 3u
// Relative luminance of the colour (ITU-R BT.709).
#define CHANNEL_LUMINANCE 4u
// The greatest magnitude of a transformed texture coordinate. Others are replaced by it, and NaN by 0.
#define TEXTURE_MAX_COORDINATE 1048576.0

// Bit of `child_flags`: a reflected ray continues from the hit. It precedes a transmitted one in the queue.
#define CHILD_REFLECTED 1u
// Bit of `child_flags`: a transmitted ray continues from the hit.
#define CHILD_TRANSMITTED 2u
// What `child_flags` has for a path that goes on. This and the next constant are counts in the two halves of a word, so
// that one prefix sum over a workgroup counts both.
#define PATH_GOES_ON 1u
// What `child_flags` has, in addition, for a path with a shadow ray to a light.
#define PATH_HAS_SHADOW_RAY 0x10000u

// `light_visibility` of a ray's hit and a light: no shadow ray was traced, since the hit would not show the light.
#define LIGHT_UNTESTED 0u
// `light_visibility` of a ray's hit and a light: the light reaches the hit.
#define LIGHT_LIT 1u
// `light_visibility` of a ray's hit and a light: something is in between.
#define LIGHT_SHADOWED 2u

// Mark of a ray whose traversal has stopped before its end. It replaces the triangle of the ray's hit, or the light's
// visibility. The bits below it are the slot that holds the ray's state, or `NO_SLOT`. The mark never equals
// `NO_TRIANGLE`, and its bits are those of a NaN that no operation makes, so that it can replace the ray's t, too.
#define SUSPENDED 0xffe00000u
// Slot of a suspended ray that found all slots taken.
#define NO_SLOT 0x1ffffeu
// Rows of four words that a slot takes in `suspended_rays`. One row of counts precedes the slots.
#define SUSPENDED_RAY_ROWS 4u
// `resume_pass` of a dispatch that takes all rays, from their beginning.
#define PASS_BEGIN 0u
// `resume_pass` of a dispatch that takes the rays that were suspended, from the state in their slots.
#define PASS_RESUME 1u
// `resume_pass` of a dispatch that takes the suspended rays that found no slot, from their beginning.
#define PASS_RESTART 2u

// Value of `Light.kind`.
#define LIGHT_POINT 0u
#define LIGHT_DIRECTIONAL 1u
#define LIGHT_SPOT 2u

// A triangle, 48 bytes.
//
// - `v0`, `v1`, `v2`: corners in world space, counter-clockwise seen from outside.
// - `n0`, `n1`, `n2`: shading normals of the corners, octahedral 2 x snorm16, or `FLAT_NORMAL`.
struct Triangle {
    vec3 v0;
    uint n0;
    vec3 v1;
    uint n1;
    vec3 v2;
    uint n2;
};

// An instance: a geometry's place in the world, 112 bytes. Triangle i of the geometry is triangle `first_triangle` + i
// of the world.
//
// - `axis_x`, `axis_y`, `axis_z`, `translation`: a point p of the geometry is at p.x `axis_x` + p.y `axis_y` +
//   p.z `axis_z` + `translation` in the world.
// - `local_x`, `local_y`, `local_z`: the rows of the inverse linear map, from the world to the geometry.
// - `condition`: the greatest sum of a row of |M| |M^-1|, M the linear map: by how much it magnifies rounding, at
//   least 1.
// - `geometry_ix`: index of the geometry. `n_triangles`: of the geometry.
// - `first_material`: index in the list of the instances' materials of the material of the geometry's slot 0.
// - `first_row`: the place of the geometry's first triangle in `triangles`.
// - `flags`: bits of `INSTANCE_MIRRORED` and its like.
struct Instance {
    vec3 axis_x;
    uint first_triangle;
    vec3 axis_y;
    uint geometry_ix;
    vec3 axis_z;
    uint first_material;
    vec3 translation;
    float condition;
    vec3 local_x;
    uint flags;
    vec3 local_y;
    uint first_row;
    vec3 local_z;
    uint n_triangles;
};

// `Instance.flags`: the linear map is a reflection. The second and the third corner of each triangle are swapped in the
// world, so that its outside stays outside.
#define INSTANCE_MIRRORED 1u
// `Instance.flags`: rays of the camera, and shadow rays, meet the instance.
#define INSTANCE_FOR_CAMERA 2u
#define INSTANCE_FOR_SHADOWS 4u
// `Instance.flags`: the instance's mask. A cast meets the instance if their masks have a bit in common, all other rays
// of paths meet it if it has any.
#define INSTANCE_FOR_OTHERS 0xff000000u
#define INSTANCE_MASK_SHIFT 24u

// What a search through a geometry needs beside the arrays, 48 bytes. `box_min`, `box_max`, `plane_epsilon` and
// `origin_reach` are those of `AccelConstants`, in the geometry's space.
//
// - `root_offset`: of the root of the geometry's kd-tree in `kd_nodes`, bytes.
// - `first_row`, `n_triangles`: the geometry's triangles in `triangles`.
// - `first_cell`: of the geometry's grid in `grid_cells`. `n_cells_x`, `n_cells_y`, `n_cells_z` and `cell_size` are
//   those of `AccelConstants`.
struct GeometryConstants {
    vec3 box_min;
    float plane_epsilon;
    vec3 box_max;
    float origin_reach;
    uint root_offset;
    uint first_row;
    uint n_triangles;
    uint first_cell;
    uint n_cells_x;
    uint n_cells_y;
    uint n_cells_z;
    float cell_size;
};

// Node of the hierarchy over the instances, 32 bytes. Nodes 2 p and 2 p + 1 are siblings; node 0 is the root, and
// node 1 is unused.
//
// - `box_min`, `box_max`: a box that holds all instances below the node, with a margin (world units).
// - `link`: number of the pair of the node's children, or of a leaf `TOP_LEAF` and the index of its only instance.
// - `parent`: index of the node above.
struct TopNode {
    vec3 box_min;
    uint link;
    vec3 box_max;
    uint parent;
};

// `TopNode.link`: the node is a leaf.
#define TOP_LEAF 0x80000000u
// Levels below the root of the hierarchy over the instances, at most. One word has a bit for each.
#define TOP_MAX_DEPTH 32u

// Four words of `instance_rows`, 16 bytes.
struct InstanceRow {
    uint x;
    uint y;
    uint z;
    uint w;
};
// Rows that an `Instance`, a `GeometryConstants` and a `TopNode` take.
#define INSTANCE_ROWS 7u
#define GEOMETRY_ROWS 4u
#define TOP_NODE_ROWS 2u

// A triangle as a leaf stores it, 48 bytes. A ray's test waits for this one load. With an index in its place, the
// test would wait for two, the index and then the triangle.
//
// - `v0`, `v1`, `v2`: the corners, as in `Triangle`.
// - `triangle_ix`: the triangle's index in `triangles`.
struct LeafTriangle {
    vec3 v0;
    uint triangle_ix;
    vec3 v1;
    uint reserved0;
    vec3 v2;
    uint reserved1;
};

// A node of the kd-tree, 8 bytes. The children of a split are neighbours, the first of them at an even index. So a
// node's sibling is `index ^ 1`. The root is node 0, and node 1 is unused.
//
// - `split_or_first`: in a split, the bits of the plane's position on the axis (a float, world units). In a leaf, the
//   index of its first entry in `leaf_triangles`.
// - `axis_and_child`: bits 0..1 are the axis of a split, bit 2 is `KD_LEAF`, bit 3 is `KD_HAS_SLAB`. For bits 4..31
//   see `KD_PAIR_SHIFT`.
struct KdNode {
    uint split_or_first;
    uint axis_and_child;
};

// The plane of a triangle in a leaf or in a grid's cell, 16 bytes. The planes of a leaf are side by side in memory,
// apart from its triangles. A point p is in the plane if `dot(normal, p) == distance`. In general, the difference of
// the two is p's height above the plane, times the normal's length.
//
// - `normal`: in a kd-tree, unit length. In a grid, the longest component is in `[1/4, 1/2)`, so the length is below
//   1 (src/accel/grid/planes.rs). 0 if the triangle has no area or its plane is not certain. Rays always test a
//   triangle whose normal here is 0.
// - `distance`: of the plane from the world's origin, along the normal, times the normal's length (world units).
struct Plane {
    vec3 normal;
    float distance;
};

// The space between two planes that holds those parts of a node's triangles that come near its cell, 16 bytes (Kay,
// Kajiya: Ray Tracing Complex Scenes, SIGGRAPH 1986). A point p is in the slab if `|dot(normal, p) - offset| <= 1`.
//
// - `normal`: the shorter it is, the thicker is the slab, whose half thickness is `1 / length(normal)` (world units).
// - `offset`: without unit, as `dot(normal, p)` is.
struct Slab {
    vec3 normal;
    float offset;
};

// A node's cell, 24 bytes: the least and the greatest corner (world units). Only some traversals need it.
struct KdBox {
    float min_x;
    float min_y;
    float min_z;
    float max_x;
    float max_y;
    float max_z;
};

// A face of a node's cell and its link to the other side, 8 bytes.
//
// - `position`: of the face on its axis (world units).
// - `node_ix`: the smallest node that contains everything on the other side of the face. 0 if the other side is
//   outside the root's cell.
struct KdRope {
    float position;
    uint node_ix;
};

// A cell of a grid, 8 bytes. At the lowest level, its triangles are the `count` entries of `leaf_triangles` from
// `first` on. At the upper level of a grid of two levels, the cell is cut into count x count x count cells. The first
// of them is `grid_cells[first]`, and x varies fastest. A count of 0 means that the cell has no triangles.
struct GridCell {
    uint first;
    uint count;
};

// A material, 160 bytes. The members up to `tf` are named as in Wavefront MTL.
//
// - `ka`, `kd`, `ks`: ambient, diffuse and specular reflectance.
// - `ns`: exponent of the Phong highlight.
// - `d`: opacity, 0..1.
// - `ni`: index of refraction.
// - `ke`: emitted radiance.
// - `flags`: bits of `MATERIAL_SPECULAR` and its like.
// - `tf`: weight of refracted light by colour.
// - `transmission`, `metallic`, `roughness`: of microfacets (shading/microfacet.glsl), 0..1.
// - `absorption`: of light in the solid behind the surface, by colour (per world unit).
// - `clearcoat`: share of the surface that a clear coat covers, 0..1. `clearcoat_roughness`: of this coat, 0..1.
// - `sheen_colour`, `sheen_roughness`: reflectance and roughness (0..1) of the sheen of cloth.
// - `conductor_eta`, `conductor_k`: complex index of refraction of a metal with `MATERIAL_CONDUCTOR`, by colour.
//
// The path tracer alone shows clearcoat, sheen and conductors (bsdf/bsdf.glsl).
//
// With microfacets, `kd` is the base colour, `ks` a factor on the reflectance of a dielectric, and `ka` the share of
// ambient light that reaches the surface.
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
    float transmission;
    vec3 absorption;
    float metallic;
    float roughness;
    float clearcoat;
    float clearcoat_roughness;
    float sheen_roughness;
    vec3 sheen_colour;
    uint reserved0;
    vec3 conductor_eta;
    uint reserved1;
    vec3 conductor_k;
    uint reserved2;
};

// A texture as a material uses it, 48 bytes. A lookup at (u, v) reads the image at (m00 u + m01 v + offset_u, m10 u +
// m11 v + offset_v), where (0, 0) is the image's upper left corner and (1, 1) its lower right one.
//
// - `first_texel`: index in `texels` of a table of `n_mips` words. Each of them is the index in `texels` of a mip
//   mip level's first texel. A mip level's texels are stored row by row, from the top.
// - `size`: of mip level 0, texels. The width is in bits 0..15, the height in 16..31. Each further mip level is half as
//   wide and half as high, rounded down, but at least 1.
// - `flags`: `TEXTURE_SRGB` and its like.
// - `n_mips`: down to the mip level of one texel.
struct Texture {
    float m00;
    float m01;
    float offset_u;
    uint first_texel;
    float m10;
    float m11;
    float offset_v;
    uint size;
    uint flags;
    uint n_mips;
    uint reserved0;
    uint reserved1;
};

// The textures of a material, 64 bytes: indices in `textures`, or `NO_TEXTURE`.
//
// - `normal_scale`: factor on x and y of the normals that `normal` shows.
// - `occlusion_strength`: how much of `occlusion` acts, 0..1.
// - `alpha_cutoff`: opacity below which rays pass through the surface, as `flags` say.
// - `opacity_factor`: opacity of the material, by which that of its textures is multiplied.
// - `flags`: `MAPS_ALPHA_MASK` and its like.
// - `coverage`: opacity of the material for rays of paths, by which that of its textures is multiplied.
struct MaterialMaps {
    uint base_colour;
    uint opacity;
    uint specular;
    uint specular_factor;
    uint emission;
    uint normal;
    uint roughness;
    uint metallic;
    uint transmission;
    uint occlusion;
    float normal_scale;
    float occlusion_strength;
    float alpha_cutoff;
    float opacity_factor;
    uint flags;
    float coverage;
};

// A light, 48 bytes.
//
// - `position`: of a point or spot light, in world space. Of a directional light, the unit vector towards the light.
// - `kind`: `LIGHT_POINT`, `LIGHT_DIRECTIONAL` or `LIGHT_SPOT`.
// - `intensity`: of a point light, power per steradian; its irradiance falls with the square of the distance. Of a
//   directional light, the irradiance on a surface that faces it. Of a spot light, power per steradian on its axis.
// - `axis`: of a spot light, the unit vector along which it shines.
// - `inner_cos`, `outer_cos`: of a spot light, cosines of the angles from the axis at which it begins to fall off, and
//   at which it ends. Of a directional light that is seen as a disk, `outer_cos` is the cosine of the disk's angular
//   radius; 0 if the light has no size. Only the path tracer knows disks.
struct Light {
    vec3 position;
    uint kind;
    vec3 intensity;
    float inner_cos;
    vec3 axis;
    float outer_cos;
};

// What emits light and can be sampled by the path tracer, 20 bytes: an entry of an alias table. If there is a light
// tree, its lights follow the table's entries. They have no threshold, `alias_ix` is the index of their leaf, and
// `probability` is that of the tree.
//
// - `threshold`: the share of the entry's samples that stay with it, 0 to 1.
// - `alias_ix`: the entry that gets the other samples.
// - `probability`: with which the entry is sampled in the end.
// - `kind`: `EMITTER_LIGHT` and its like.
// - `ix`: index of the light, the area light, the sun or the triangle; 0 for the environment and for the tree.
struct Emitter {
    float threshold;
    uint alias_ix;
    float probability;
    uint kind;
    uint ix;
};

// The kinds of emitters, in the order of their entries. The entries of triangles are in the order of the triangles.
// A point, spot or directional light without a size.
#define EMITTER_LIGHT 0u
// A rectangle, a disk or a sphere.
#define EMITTER_AREA 1u
// A directional light that is seen as a disk.
#define EMITTER_SUN 2u
// A triangle whose material emits light.
#define EMITTER_TRIANGLE 3u
// What is seen beyond the scene.
#define EMITTER_ENVIRONMENT 4u
// The light tree: one of its lights is sampled.
#define EMITTER_TREE 5u

// A node of the light tree, 48 bytes: what its lights send where. Nodes are in preorder: the left child of an inner
// node follows it.
//
// - `centre`, `radius`: a sphere around the lights, world units.
// - `axis`, `cos_spread`: a cone that holds the lights' own axes, as a unit vector and the cosine of the angle.
//   -1: the lights shine in all directions.
// - `intensity`: sum of what the lights emit along their axes, as a share of the whole tree.
// - `cos_end`: cosine of the greatest angle to its own axis at which one of the lights shines.
// - `next`: of an inner node the index of the right child, of a leaf the index of the `Emitter`.
// - `flags`: `LIGHT_NODE_LEAF` and its like.
struct LightNode {
    vec3 centre;
    float radius;
    vec3 axis;
    float cos_spread;
    float intensity;
    float cos_end;
    uint next;
    uint flags;
};

// The node is a leaf, which has one light.
#define LIGHT_NODE_LEAF 1u
// Some of the lights shine to both sides. `cos_spread` is then not negative.
#define LIGHT_NODE_TWO_SIDED 2u

// A light with an area or, for a sun, with a solid angle, 80 bytes. Only the path tracer knows such lights.
//
// - `position`: centre, world space. Of a sun, the unit vector to the disk's centre.
// - `kind`: `AREA_RECTANGLE` and its like.
// - `radiance`: emitted radiance, the same in all directions.
// - `radius`: of a disk or a sphere, world units. Of a sun, 1 less the cosine of the disk's angular radius.
// - `axis`: unit vector. A rectangle and a disk shine to the side to which it points.
// - `area`: square world units. Of a sun, the disk's solid angle.
// - `edge_u`, `edge_v`: from the centre of a rectangle to the middle of an edge. Of a disk and a sun, unit vectors.
//   They are at right angles to one another and to the axis.
// - `probability`: with which the light is sampled, or the light tree if the light is in it.
// - `leaf_ix`: index of the light's node in the light tree. 0: the light is in no tree, or is alone in it.
struct AreaLight {
    vec3 position;
    uint kind;
    vec3 radiance;
    float radius;
    vec3 axis;
    float area;
    vec3 edge_u;
    float probability;
    vec3 edge_v;
    uint leaf_ix;
};

// The kinds of area lights.
#define AREA_RECTANGLE 0u
#define AREA_DISK 1u
#define AREA_SPHERE 2u
#define AREA_SUN 3u

// Replaces the index of an array in `texture_words` that the scene does not have.
#define NO_WORDS 0xffffffffu

// What a corner of a triangle has beside its position and normal, 8 bytes.
//
// - `tangent`: unit tangent along increasing u, octahedral 2 x snorm16. The lowest bit is replaced: it is 1 if the
//   bitangent, along decreasing v, is the cross product of normal and tangent, and 0 if it is the opposite.
//   `FLAT_NORMAL` if there is no tangent.
// - `colour`: 8 bits a channel, red in the lowest byte. Colours are sRGB, opacity is linear.
struct CornerSurface {
    uint tangent;
    uint colour;
};

// The number of textures of a material.
#define N_MAPS 10u
// The places of the textures in `MaterialMaps`.
#define MAP_BASE_COLOUR 0u
#define MAP_OPACITY 1u
#define MAP_SPECULAR 2u
#define MAP_SPECULAR_FACTOR 3u
#define MAP_EMISSION 4u
#define MAP_NORMAL 5u
#define MAP_ROUGHNESS 6u
#define MAP_METALLIC 7u
#define MAP_TRANSMISSION 8u
#define MAP_OCCLUSION 9u

// `MaterialMaps.flags`: rays pass through the surface where its opacity is below `alpha_cutoff`.
#define MAPS_ALPHA_MASK 1u
// `MaterialMaps.flags`: shadow rays, but no others, pass through the surface where its opacity is below `alpha_cutoff`.
#define MAPS_SHADOW_TEST 2u
// `MaterialMaps.flags`: rays of paths pass through the surface at random, as often as its opacity says.
#define MAPS_ALPHA_BLEND 16u
// `MaterialMaps.flags`: the surface is blended, and rays pass through it where its opacity is below
// `LEAST_SEEN_OPACITY`, as through a masked one: cards of leaves or hair are mostly holes.
#define MAPS_CLEAR_TEST 32u
// `MaterialMaps.flags`: the opacity of the base colour's texture counts.
#define MAPS_COLOUR_HAS_OPACITY 4u
// `MaterialMaps.flags`: the opacity of the corners' colours counts.
#define MAPS_CORNERS_HAVE_OPACITY 8u

// A ray of a picture, 48 bytes. Its hits have t in `(0, t_max]`. In frames with `Frame.extra_bounces`, `t_max` also
// says the ray's depth (shading/children.glsl).
//
// - `origin`: world units.
// - `pixel_ix`: index of the pixel that receives the ray's light, rows from the top of the window.
// - `direction`: unit length.
// - `source_triangle`: the triangle on which the ray starts, which it never hits again, or `NO_TRIANGLE`.
// - `throughput`: the weight of the ray's radiance in its pixel.
// - `t_max`: world units.
struct PathRay {
    vec3 origin;
    uint pixel_ix;
    vec3 direction;
    uint source_triangle;
    vec3 throughput;
    float t_max;
};

// A ray that is cast by itself, not for a picture, 32 bytes. The length of `direction` is arbitrary; it is the unit
// of t. Hits have t in `(t_min, t_max]`. All numbers are valid as `t_min` and `t_max`. An end that is less than 1e-36
// world units from the ray's origin may count as 0, since devices may flush denormals. Otherwise both ends are exact
// to the last bit if the origin is within `AccelConstants.origin_reach`. If it is not, they are exact to 2^-23 of the
// distance from the ray's origin to the scene, or of the origin's distance from 0 if that is greater, and the t of hits
// is in the interval nevertheless.
struct Ray {
    vec3 origin;
    float t_min;
    vec3 direction;
    float t_max;
};

// A point whose closest point on the triangles is sought, 16 bytes.
//
// - `position`: of the point, world units.
// - `t_max`: the greatest distance of its closest point, world units. It may be infinite.
struct QueryPoint {
    vec3 position;
    float t_max;
};

// A path of a picture, 16 bytes: what is known of it beside its ray.
//
// - `radiance`: the light that the path has brought to its pixel so far.
// - `pdf`: of the direction in which the path goes on, among those that could have been sampled (per steradian). 0
//   if no light can be sampled in its place: the ray comes from the camera or from a perfectly smooth surface.
struct PathState {
    vec3 radiance;
    float pdf;
};

// A shadow ray from a hit of a path to a sampled light, 48 bytes. If nothing is in between, its light is added to the
// path.
//
// - `origin`: world units.
// - `state`: `SHADOW_RAY_NONE`, `SHADOW_RAY_WAITS`, or the mark of a shadow ray whose traversal was suspended.
// - `direction`: unit length.
// - `source_triangle`: the triangle on which the shadow ray starts, which it never hits again.
// - `light`: what the shadow ray adds to the path's radiance.
// - `t_max`: length of the shadow ray (world units).
struct ShadowRay {
    vec3 origin;
    uint state;
    vec3 direction;
    uint source_triangle;
    vec3 light;
    float t_max;
};

// `ShadowRay.state`: the path has no shadow ray.
#define SHADOW_RAY_NONE 0u
// `ShadowRay.state`: the shadow ray has not been traced yet.
#define SHADOW_RAY_WAITS 1u

// Values of `Frame.pixel_filter`: the pdf of samples around the centre of their pixel.
//
// The square of the pixel.
#define FILTER_BOX 0u
// A tent on each axis, which ends at the centres of the neighbouring pixels.
#define FILTER_TENT 1u
// A Gaussian of standard deviation 0.5 px, up to 1.5 px from the centre.
#define FILTER_GAUSSIAN 2u
// All samples are at the pixel's centre.
#define FILTER_CENTRE 3u
// Base-2 logarithm of the number of samples in a block. Parts of a picture's samples begin and end at multiples of it.
#define SAMPLE_BLOCK_LOG2 4u
// Base-2 logarithm of the most samples of each pixel that a frame of paths draws.
#define MOST_SAMPLES_LOG2 8u
// Side of a noise tile, which gets samples until its noise is low (pixels). A multiple of `PIXEL_GROUP_SIZE`.
#define NOISE_TILE_SIZE 16u
// The most noise tiles that are drawn together. Their words fill the smallest uniform buffer that a device may have.
#define MOST_NOISE_TILES 4096u
// `Frame.window_x` if the window is a column of noise tiles (rays/noise_tiles.glsl).
#define WINDOW_OF_NOISE_TILES 0xffffffffu
// The least pdf, per steradian, with which a lobe samples a direction in which it sees the studio. That of diffuse
// surfaces is at most 1 / pi.
#define STUDIO_LEAST_PDF 1.0
// Number of the layers of light (path_layers.comp).
#define LIGHT_LAYERS 3u
// Number of the layers of what camera rays hit: albedo and normal (surface_layers.comp).
#define SURFACE_LAYERS 2u
// The bounce of a path, counted from 0, from which on it may end by Russian roulette.
#define ROULETTE_DEPTH 3u
// The least probability with which a path survives Russian roulette. It bounds the weight of those that survive.
#define LEAST_SURVIVAL 0.05
// The most light that a path adds to its pixel at a time, in any colour. The sum of a pixel's samples is then finite.
#define MOST_ADDED_LIGHT 1.0e30
// The share of the distance to a light at which a shadow ray ends, so that it does not hit the light itself.
#define SHADOW_RAY_SHARE 0.9998

// The hit of a ray, 16 bytes.
//
// - `t`: in units of the ray's direction. For a miss, infinity in a cast, and the ray's `t_max` in a frame.
// - `triangle_ix`: index of the triangle. `NO_TRIANGLE` for a miss.
// - `u`, `v`: barycentric weights of `v1` and `v2`.
struct Hit {
    float t;
    uint triangle_ix;
    float u;
    float v;
};

// The frame's constants, 288 bytes (a uniform buffer, std140-compatible). The window is the part of the picture that
// is rendered. The point of the window's pixel (x, y) in the image plane is
//
// ```text
// (2 (window_x + x + sample_x) / picture_width - 1) * right + (1 - 2 (window_y + y + sample_y) / picture_height) * up
// ```
//
// The camera ray of the pixel begins at `eye` in the direction of `forward` plus this point. That of an orthographic
// camera begins at `eye` plus this point, in the direction of `forward`.
//
// - `clip_from_world`: world space to the clip space of the whole picture. It is shifted within a pixel so that the
//   frame's sample is at the centre of its pixel, where the rasterizer samples.
// - `eye`: world space. `forward`: unit length. `right`, `up`: from the middle of the image plane to its right and its
//   upper edge. The image plane is at distance 1 from the eye, that of an orthographic camera contains the eye.
// - `width`, `height`: of the window (pixels).
// - `n_triangles`, `n_lights`: of the scene.
// - `ambient`: irradiance that every point receives, weighted by `Material.ka`. `background`: radiance of rays that
//   hit nothing.
// - `ambient_tilt`: irradiance that a surface which faces up receives beside `ambient`, and that one which faces down
//   lacks. `up_axis`: index of the coordinate that points up, 1 or 2.
// - `exposure`: factor of radiance before the tone curve.
// - `denoise_threshold`: a pixel is smoothed if the differences between its luminance and those of its four
//   neighbours add up to more than this.
// - `max_depth`: bounces, of which the camera's rays are the first: one for each ray depth, and `extra_bounces`.
// - `queue_capacity`: rays that the ray queue has room for.
// - `picture_width`, `picture_height`: of the whole picture (pixels).
// - `window_x`, `window_y`: the picture's pixel at which the window begins. Of paths, `window_x` can also be
//   `WINDOW_OF_NOISE_TILES`, and `window_y` is the number of samples that each tile gets then.
// - `sample_x`, `sample_y`: position of the frame's sample in each pixel (pixels from its upper left corner).
// - `n_samples`: samples of each pixel so far, including this frame's.
// - `n_lanes`: lanes of the device, which are shared out if there are fewer rays. 0: each ray gets one lane.
// - `is_orthographic`: 1 for an orthographic camera, 0 for a perspective one. Kernels are made for one of the two
//   (`CONSTANT_ORTHOGRAPHIC`).
// - The rest is for frames of paths. `samples_log2`: the frame draws `2^samples_log2` samples of each pixel.
//   `first_sample`: the index of the first of them. `range_begin`: the index of the first sample of the picture, which
//   can be one part of all samples of its seed. `pixel_filter`: `FILTER_BOX` and its like. `clamp`: the most light that
//   a path adds to its pixel after its first hit, in any colour (radiance; infinity: any amount).
//   `aperture`: radius of the lens (world units; 0: everything is sharp). `focus`: distance of what is sharp from the
//   eye, along `forward` (world units). `focuses_on_target`: 1 if that is the distance of the camera's target.
//   `samples_reciprocal`: 1 / `n_samples`. The host divides, because devices round quotients in different ways.
// - `has_studio`: 1 if metals and glass mirror a studio (shading/studio.glsl). `to_viewer`: horizontal unit vector
//   towards the viewer for whom it was set up, world space.
// - `extra_bounces`: bounces in addition to the ray depths, for rays that pass straight through blended surfaces, which
//   make them no deeper. 0 if the scene has no such surfaces, and in frames of paths.
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
    vec3 ambient_tilt;
    uint up_axis;
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
    uint is_orthographic;
    uint samples_log2;
    uint first_sample;
    uint pixel_filter;
    float clamp;
    float aperture;
    float focus;
    uint focuses_on_target;
    uint range_begin;
    float samples_reciprocal;
    vec3 to_viewer;
    uint has_studio;
    uint extra_bounces;
    uint reserved0;
    uint reserved1;
    uint reserved2;
};

// The rays of one bounce of one batch, 80 bytes. The host writes the row of a batch's first bounce, and in all rows the
// y and z of the `groups`. Compaction of each bounce's rays (`compact_spine.comp`) writes the rest of the next bounce's
// row, and `n_shadow_rays` of the bounce's own. The rays of a batch are in one queue, bounce after bounce. Each
// `groups` is a `VkDispatchIndirectCommand`.
//
// - `first_ray`, `n_rays`: the bounce's rays in the queue.
// - `n_wanted`: child rays of the bounce before, including those for which the queue has no room.
// - `overflow`: 1 if the queue has no room for all of these rays. Then `n_rays` is 0, and the batch has to be split.
// - `trace_groups`: over the bounce's rays, each of which has `2^trace_lanes_log2` lanes. Only the first lane of a
//   ray works (src/frame/bounce.rs).
// - `shadow_groups`: over the shadow rays from hits to lights. y counts lights, x all rays of the batch up to the last
//   one of this bounce. A shadow ray has `2^shadow_lanes_log2` lanes.
// - `scan_groups`: over the bounce's rays.
// - `any_overflow`: in the first row of `bounces` only, 1 if any row of the frame has an overflow.
// - `shade_groups`: over all rays of the batch up to the last one of this bounce.
// - `n_shadow_rays`: in frames of paths, the number of shadow rays from the bounce's hits to lights. The next bounce's
//   dispatch of path_trace.comp reads it.
//
// In frames of paths, the rays of a bounce are those of the paths that are alive, `first_ray` is 0, and
// `trace_groups` also count the shadow rays of the bounce before.
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
    uint n_shadow_rays;
};

// Copies of a bounce's `Counters`, whose sum is the count. This many workgroups can add to them at the same time.
#define COUNTER_COPIES 16u
// Distance of these copies in `counters`, in elements. It keeps them from sharing a cache line.
#define COUNTER_STRIDE 16u

// Counts for the profile, 8 bytes. Each batch and bounce has `COUNTER_COPIES` of them. Integer sums are the same in
// every order of arrival.
//
// - `n_hits`: rays that hit a triangle.
// - `n_shadow_rays`: shadow rays that were tested.
struct Counters {
    uint n_hits;
    uint n_shadow_rays;
};

// The first hit of a pixel's sample, and the cost of all rays of the sample, 64 bytes. If nothing is hit, `depth` is
// infinity, both indices are `NO_TRIANGLE`, and the vectors are 0.
//
// - `position_world`: world units.
// - `triangle_ix`, `material_ix`: indices of the triangle and of its material.
// - `normal_world`: the shading normal, unit length, towards the eye.
// - `albedo`: the material's `kd`.
// - `depth`: distance from the eye along `Frame.forward` (world units). For an orthographic camera, it is the length of
//   the ray.
// - `n_rays`: primary, secondary and shadow rays.
// - `n_steps`: nodes, slabs, cells of a grid and triangles of leaves that all of these rays read.
// - `variance`, `n_samples`: of the mean luminance of the pixel of a picture of paths, and the number of its samples.
//   Kernels do not know them: the host sets them when the picture is complete.
struct PixelAovs {
    vec3 position_world;
    uint triangle_ix;
    vec3 normal_world;
    uint material_ix;
    vec3 albedo;
    float depth;
    uint n_rays;
    uint n_steps;
    float variance;
    uint n_samples;
};

// What the noise filter `edge` knows of a pixel beside its colour, 64 bytes: means over its samples so far.
//
// - `position_world`: mean of the first hits' points (world units). `n_hits`: number of samples that have one.
// - `normal_world`: mean of the first hits' shading normals, not of unit length.
// - `gloss`: mean of the first hits' `surface_gloss`, 0..1.
// - `albedo`: mean share of light that the first hit scatters (`surface_albedo`). A sample without a hit has 0.
// - `seen`: mean of the light that camera rays meet: emission, lamps and what is beyond the scene.
// - `seen_squared`: mean of the squared luminance of this light.
// - `n_samples`: number of samples of these means.
struct Auxiliary {
    vec3 position_world;
    uint n_hits;
    vec3 normal_world;
    float gloss;
    vec3 albedo;
    float seen_squared;
    vec3 seen;
    uint n_samples;
};

// What kernels need of the scene's triangles and acceleration structure besides the arrays (a uniform buffer).
//
// - `box_min`, `box_max`: the box that holds all triangles, with the structure's rounding margin (world units). In
//   a grid, `box_min` is the least corner of the first cell.
// - `plane_epsilon`: `KD_PLANE_EPSILON` times the greatest magnitude of a coordinate of that box (world units). In a
//   world of instances, the share of the distance of a ray's origin by which boxes are too small for it if the origin
//   is beyond `origin_reach`.
// - `n_triangles`: that are stored: of the scene, or of all geometries.
// - `n_cells_x`, `n_cells_y`, `n_cells_z`: cells of a grid's upper level along each axis.
// - `cell_size`: edge of a cell of a grid's upper level (world units).
// - `uvs_begin`, `corners_begin`, `material_maps_begin`, `textures_begin`: index in `texture_words` at which the
//   triangles' texture coordinates, the tangents and colours of their corners, the materials' maps and the textures
//   begin. `NO_WORDS`: the scene has none of them.
// - `background`: radiance of the environment if it has no map.
// - `ambient`, `ground_ambient`: radiance that neither the camera nor mirrors see, from above and from below.
//   `up_axis`: index of the coordinate that points up, 1 or 2.
// - `environment_probability`: with which the environment is sampled as a light.
// - `n_emitters`, `emitters_begin`: number of entries of the alias table of emitters, and index in `texture_words` of
//   the first `Emitter`.
// - `first_triangle_emitter`, `n_triangle_emitters`: index and number of the entries of triangles.
// - `area_lights_begin`, `n_area_lights`, `n_suns`: index in `texture_words` of the first `AreaLight`, number of those
//   that are no suns, and number of suns, which follow them.
// - `environment_begin`: index in `texture_words` of the environment's map: pairs of a threshold and an alias, first
//   for each row and then for each texel, and the texels. A texel is a linear colour, and the pdf with which its
//   directions are sampled if the environment is sampled, per steradian. `NO_WORDS`: there is no map.
// - `light_nodes_begin`: index in `texture_words` of the first `LightNode`. `NO_WORDS`: there is no light tree.
// - `environment_width`, `environment_height`: size of the map, texels.
// - `environment_turn`: by which the map is turned about +y, in turns, counter-clockwise as seen from above.
// - `origin_reach`: the greatest magnitude of a coordinate of a ray's origin up to which the origin is not moved (world
//   units). It is `KD_MAX_ORIGIN_DISTANCE` times the greatest magnitude of a coordinate of the box, or less if
//   the triangles have several scales (src/accel/kdtree/scales.rs).
// - `geometries_begin`, `top_nodes_begin`, `instance_firsts_begin`, `instance_materials_begin`: rows of
//   `instance_rows` at which its parts behind the instances begin. 0 without instances.
// - The rest: the device address of each of the scene's arrays, low word first. 0 if kernels read the array by its
//   binding.
struct AccelConstants {
    vec3 box_min;
    float plane_epsilon;
    vec3 box_max;
    uint n_triangles;
    uint n_cells_x;
    uint n_cells_y;
    uint n_cells_z;
    float cell_size;
    uint uvs_begin;
    uint corners_begin;
    uint material_maps_begin;
    uint textures_begin;
    vec3 background;
    float environment_probability;
    vec3 ambient;
    uint n_emitters;
    vec3 ground_ambient;
    uint up_axis;
    uint emitters_begin;
    uint first_triangle_emitter;
    uint n_triangle_emitters;
    uint area_lights_begin;
    uint n_area_lights;
    uint n_suns;
    uint environment_begin;
    uint environment_width;
    uint environment_height;
    float environment_turn;
    uint light_nodes_begin;
    float origin_reach;
    uint geometries_begin;
    uint top_nodes_begin;
    uint instance_firsts_begin;
    uint instance_materials_begin;
#define ARRAY(name, element, row, number) uvec2 name;
#include "scene_arrays.glsl"
#undef ARRAY
};

// Specialization constants. Each has one number, one type and one meaning in all kernels. A kernel that uses one
// declares it as `layout(constant_id = CONSTANT_X) const TYPE X = DEFAULT;`, and Rust sets it as `constants::X`.
// build.rs refuses two constants with the same number. In a kernel, it refuses a declaration of X whose number is not
// `CONSTANT_X`, and an X for which this list has no number.

// Whether `fma` rounds once on the device.
#define CONSTANT_FUSED_FMA 1u
// Whether hits and shadow rays are counted.
#define CONSTANT_COUNTS 2u
// Whether the nodes and triangles that a ray reads are counted.
#define CONSTANT_COUNT_COSTS 3u
// Whether the device runs both sides of a branch for all lanes (predication), as software drivers do.
#define CONSTANT_PREDICATES_BRANCHES 4u
// Whether the rays are the camera's.
#define CONSTANT_FROM_CAMERA 5u
// Whether the camera is orthographic: its rays are parallel.
#define CONSTANT_ORTHOGRAPHIC 6u
// Whether a search may end at any hit, instead of finding the closest one.
#define CONSTANT_ANY_HIT 7u
// Whether the hits of rays are listed, and not only counted.
#define CONSTANT_LISTS_HITS 33u
// The curve that maps radiance to the display's range: `TONEMAP_LINEAR` and its like.
#define CONSTANT_CURVE 8u
// Whether compute kernels, and not the graphics pipeline, found the triangle that each pixel shows.
#define CONSTANT_SOFTWARE_RASTER 9u

// Whether the frame traces paths, whose rays are all stored, and not the ray trees of the paper.
#define CONSTANT_PATHS 12u
// The kinds of emitters that the scene may have, as bits: `1 << EMITTER_AREA` and its like, `EMITTERS_MAP`, and
// `EMITTERS_SHAPE << AREA_DISK` and its like. Kernels are made without the code for the others.
#define CONSTANT_EMITTERS 13u
// The environment has a map.
#define EMITTERS_MAP 0x100u
#define EMITTERS_SHAPE 0x10000u
// The lobes that the scene's materials may have in the path tracer, as bits: `LOBE_INTERFACE` and its like. Kernels are
// made without the code for the others.
#define CONSTANT_LOBES 14u
// An interface that reflects light or lets it pass.
#define LOBE_INTERFACE 1u
// A metal.
#define LOBE_METAL 2u
// A metal whose complex index of refraction is given.
#define LOBE_CONDUCTOR 4u
// Light that passes through the surface.
#define LOBE_TRANSMISSION 8u
#define LOBE_CLEARCOAT 16u
#define LOBE_SHEEN 32u
// Invocations of a workgroup that computes a prefix sum: `SCAN_GROUP_SIZE`, except in compact_spine.comp, where it is
// at most `SPINE_MOST_INVOCATIONS`.
#define CONSTANT_SCAN_SIZE 15u

// The first layer of surfaces in `pixel_radiance`.
#define CONSTANT_FIRST_SURFACE_LAYER 16u
// Whether a kernel builds the lower level of a grid.
#define CONSTANT_LOWER_LEVEL 10u
// Which counts a prefix sum in a grid's build adds up. The first three values equal those of `GRID_COUNTS_CELLS` and
// its like.
#define CONSTANT_SCANS 11u
#define GRID_SCANS_CELLS 0u
#define GRID_SCANS_COLUMNS 1u
#define GRID_SCANS_PAIRS 2u
#define GRID_SCANS_DIGITS 3u

// Constants that have the same value in all kernels over one scene.

// Whether the scene has textures, or colours at the corners of triangles.
#define CONSTANT_TEXTURED 24u
// Whether the scene has materials of microfacets.
#define CONSTANT_MICROFACETS 25u
// Whether rays of all kinds are alpha-tested: whether there are masked materials (shading/alpha_test.glsl).
#define CONSTANT_ALPHA_MASKS 26u
// Whether some triangles have normals at their corners.
#define CONSTANT_SMOOTH 22u
// Whether shadow rays are alpha-tested: whether there are masked or blended materials.
#define CONSTANT_SHADOW_ALPHA_TEST 23u

// Whether rays can pass through blended surfaces without getting deeper: whether there are such surfaces.
#define CONSTANT_BLENDED 20u
// Whether camera rays pass through back faces: whether there are single-sided materials (shading/back_faces.glsl).
#define CONSTANT_CULLS_BACK_FACES 21u

// Whether rays pass through triangles with `TRIANGLE_HIDDEN` in `triangle_materials`.
#define CONSTANT_SKIPS_HIDDEN 28u
// Levels of cells of the scene's grid, 1 or 2. 0: the scene has a kd-tree.
#define CONSTANT_GRID_LEVELS 27u
// Loop iterations that an invocation takes before its ray is suspended. 0: any number.
#define CONSTANT_ITERATION_BUDGET 29u
// Words of the traversal's bit mask, 1 or 2.
#define CONSTANT_MASK_WORDS 30u
// Whether the world is geometries and instances of them, not triangles alone.
#define CONSTANT_INSTANCED 32u
// How kernels read the scene: `READING_BOUND` and its like.
#define CONSTANT_READING 31u
// Kernels read the scene's arrays as bound storage buffers.
#define READING_BOUND 0u
// Kernels read the scene's arrays as texels.
#define READING_TEXELS 1u
// Kernels read the scene's arrays by device address.
#define READING_ADDRESS 2u

// Push constants of the kernels of a frame.
//
// - `first_pixel`, `n_pixels`: the batch's pixels, `[first_pixel, first_pixel + n_pixels)` in the order of the queue.
// - `bounce_ix`: index of the batch's row in `bounces` for the bounce of this depth. Kernels that light the rays of
//   all bounces get the batch's first row.
// - `depth`: of the bounce, 0 for the camera's rays and for kernels that light all rays.
// - `resume_pass`: `PASS_BEGIN` and its like.
struct Batch {
    uint first_pixel;
    uint n_pixels;
    uint bounce_ix;
    uint depth;
    uint resume_pass;
};

// Values of `FalseColor.view`: the member of `PixelAovs` that is displayed.
#define VIEW_DEPTH 1u
#define VIEW_NORMAL 2u
#define VIEW_ID 3u
#define VIEW_COST 4u
#define VIEW_RAYS 5u

// Push constants of `false_color.comp`.
//
// - `view`: `VIEW_DEPTH` and its like.
// - `brightest`: for cost and rays, the value that is brightest. For depth, the value of half brightness (world
//   units).
struct FalseColor {
    uint view;
    float brightest;
};

// Push constants of `atrous_filter.comp`: the number of the filter's iteration, from 0 to `N_ATROUS_ITERATIONS - 1`.
struct AtrousIteration {
    uint iteration_ix;
};

// The number of iterations of the noise filter `edge`, which is odd. Iteration i compares pixels at multiples of 2^i
// pixels.
#define N_ATROUS_ITERATIONS 5u
// How far the light of another pixel can get by all iterations: 2 * (2^N_ATROUS_ITERATIONS - 1), and the radius of the
// square in which the variance is estimated (pixels).
#define EDGE_BORDER 65u

// Push constants of `present.frag`, which shows a picture in a window: the sizes of both (pixels).
struct Present {
    uint width;
    uint height;
    uint window_width;
    uint window_height;
};

// A triangle with a large bounding rectangle, 16 bytes. The rectangle is cut into blocks, which are numbered row by
// row.
//
// - `triangle_ix`: the triangle's index.
// - `first_block`: number of the triangle's first block among those of all large triangles.
// - `first`, `size`: the rectangle's first pixel in the window, and its sides (pixels). x is in bits 0..15, y in
//   16..31.
struct LargeTriangle {
    uint triangle_ix;
    uint first_block;
    uint first;
    uint size;
};

// The workgroups over the blocks of large triangles, 16 bytes: a `VkDispatchIndirectCommand` and a spare word. In the
// same buffer, 8 bytes of counts follow: the number of large triangles in the upper half, the number of their blocks
// in the lower. After 8 spare bytes come the large triangles.
struct RasterGroups {
    uint x;
    uint y;
    uint z;
    uint reserved;
};

// Push constants of the kernels that rasterize. The sides of blocks are `2^block_log2` pixels.
struct RasterPush {
    uint block_log2;
};

// Push constants of a cast, and of a search for all hits.
//
// - `n_rays`: rays of the cast.
// - `lanes_log2`: each ray has `2^lanes_log2` lanes, of which the first works.
// - `resume_pass`: `PASS_BEGIN` and its like.
// - `mask`: the cast's mask, shifted as that in `Instance.flags`.
// - `bare_rays`: whether rays are origins and directions alone, 24 bytes. Then their t is from 0 to infinity.
// - `bare_hits`: whether hits are t alone, 4 bytes. That of a miss is infinite.
struct CastBatch {
    uint n_rays;
    uint lanes_log2;
    uint resume_pass;
    uint mask;
    uint bare_rays;
    uint bare_hits;
};

// How far a ray is on its way from hit to hit, 28 bytes (all_hits.comp).
//
// - `t`, `triangle_ix`: the last hit, `NO_TRIANGLE` before the first one. `t` is counted from the ray's origin as the
//   search has moved it, in the space of the hit's instance if there are instances.
// - `next_ix`: where the next hit belongs. If hits are only counted, it is their number.
// - `end_ix`: the value of `next_ix` at which the ray ends.
// - `mark`: that of a suspended ray, or `NO_TRIANGLE`.
// - `top_node`, `top_pending`: the place in the hierarchy over the instances, 0 before the first search.
struct HitCursor {
    float t;
    uint triangle_ix;
    uint next_ix;
    uint end_ix;
    uint mark;
    uint top_node;
    uint top_pending;
};

// Push constants of a cast by the driver's own ray tracing: the device address of its acceleration structure.
struct DriverCast {
    uint accel_address_low;
    uint accel_address_high;
};

// The build of a grid (src/passes/grid). grid/grid_build.glsl defines its terms: pair, item, column and block.

// The most attempts to build a level of cells within the limit of references. The last one has the largest cells.
#define GRID_MAX_ATTEMPTS 4u
// The most columns, as a multiple of the most references. In many columns of a long triangle's box, no cell contains
// the triangle.
#define GRID_COLUMNS_PER_REFERENCE 4u
// How many halvings of its resolution turn the finest block, which has `GRID_MAX_BLOCK_RESOLUTION` cells along each
// axis, into one cell.
#define GRID_MAX_HALVINGS 5u
// Counts above this are all replaced by 2^32 - 1.
#define GRID_MAX_COUNT 0x7fffffffu
// How many rows of entries a workgroup goes through. A row has `SCAN_GROUP_SIZE` entries, one for each invocation.
#define GRID_ROWS 8u
// The number of entries in these rows, `GRID_ROWS * SCAN_GROUP_SIZE`.
#define GRID_BLOCK_SIZE 1024u
// Workgroups of a dispatch side by side. More are in further rows, since a device need not accept more than 65,535.
#define GRID_GROUPS_X 1024u
// Bits of the cells' indices by which one pass of the sort sorts.
#define GRID_DIGIT_BITS 4u
// The number of values that these bits have.
#define GRID_DIGITS 16u
// The most workgroups of a pass of the sort. Each sorts several blocks one after the other if there are more blocks.
#define GRID_MAX_SORT_GROUPS 1024u

// Value of `GridBuild.counts`: the attempt counts the cells of the lower level next.
#define GRID_COUNTS_CELLS 0u
// Value of `GridBuild.counts`: the attempt counts the columns of cells in the items' boxes next.
#define GRID_COUNTS_COLUMNS 1u
// Value of `GridBuild.counts`: the attempt counts the pairs of a cell and a triangle next.
#define GRID_COUNTS_PAIRS 2u
// Value of `GridBuild.counts`: everything is counted.
#define GRID_IS_COUNTED 3u

// The state of a grid's build. The host writes it before the build and reads it afterwards.
struct GridBuild {
    // The lattice of the uniform grid or of the upper level: its box and the edge of a cell (world units).
    // margin: a triangle counts as inside a cell up to this distance outside (world units).
    vec3 box_min;
    float cell_size;
    vec3 box_max;
    float margin;
    // n_cells_*: cells of this lattice along each axis.
    // largest_coordinate: the greatest magnitude of a coordinate of box_min and box_max, which are the bounds of the
    // finite triangles grown by the margin (world units).
    uint n_cells_x;
    uint n_cells_y;
    uint n_cells_z;
    float largest_coordinate;
    // The bounds of the finite triangles, the number of these triangles, and the number of all triangles. A bound is
    // stored as an integer, such that integers compare as the floats do (grid_bounds.comp).
    uint least_x;
    uint least_y;
    uint least_z;
    uint n_finite;
    uint greatest_x;
    uint greatest_y;
    uint greatest_z;
    uint n_triangles;
    // What the host requires. *_density: cells for each triangle. max_references: the most pairs of a level, and also
    // the most cells of the lower level. max_columns: the most columns.
    float upper_density;
    float lower_density;
    uint max_references;
    uint max_columns;
    // What is counted. n_items: at the upper level its triangles, at the lower level the pairs of the upper level.
    // n_columns, n_pairs: of these items. n_upper: cells of the upper level, or of the only one. n_lower: cells of
    // the lower level. n_filled_*: those of these cells that have triangles.
    uint n_items;
    uint n_columns;
    uint n_pairs;
    uint n_upper;
    uint n_lower;
    uint n_filled_upper;
    uint n_filled_lower;
    // How the build continues. n_coarser: how many times the edges of the upper level's cells were doubled.
    // n_halvings: how many times the blocks' resolutions were halved. n_attempts: failed attempts at this level.
    // counts: GRID_COUNTS_CELLS and its like.
    uint n_coarser;
    uint n_halvings;
    uint n_attempts;
    uint counts;
    // The indices in scan_blocks at which the sums of blocks of columns, of pairs and of upper cells begin. Those of
    // the sort begin at 0.
    uint columns_begin;
    uint pairs_begin;
    uint cells_begin;
    // Blocks that a workgroup of the sort goes through.
    uint blocks_per_group;
    // Workgroups of an attempt's indirect dispatches, in their order: over upper cells, over items, over columns.
    // They are 0, except for the dispatch that counts what `counts` says.
    uint cell_groups_x;
    uint cell_groups_y;
    uint cell_groups_z;
    uint item_groups_x;
    uint item_groups_y;
    uint item_groups_z;
    uint column_groups_x;
    uint column_groups_y;
    uint column_groups_z;
    // Workgroups over columns, pairs and upper cells, and of the sort, once everything is counted.
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

// The build of a kd-tree (src/passes/kdtree). kdtree_build/kd_build.glsl defines its terms.

// Rows of entries that a workgroup goes through. A row has `SCAN_GROUP_SIZE` entries, one for each invocation.
#define KD_ROWS 8u
// The number of entries in these rows, a block: `KD_ROWS * SCAN_GROUP_SIZE`.
#define KD_BLOCK_SIZE 1024u
// Workgroups of a dispatch side by side. More are in further rows, since a device need not accept more than 65,535.
#define KD_GROUPS_X 1024u
// The most references of a small cell, whose planes are all tried.
#define KD_SMALL_CELL 64u
// References among which a workgroup of `kdtree_choose` looks for cells that are not small, by every `KD_SMALL_CELL`-th
// one.
#define KD_CHOOSE_BLOCK 256u
// The number of references that one workgroup counts by bins at a time. A cell with more is large.
#define KD_BIN_BLOCK 2048u
// Bins on an axis: one for each invocation of a workgroup.
#define KD_BINS 128u
// Words of a cell's bins: on each axis, four for each bin.
#define KD_BIN_WORDS 1536u
// Scales of triangles, 0 to 18 (src/accel/kdtree/scales.rs).
#define KD_SCALES 19u
// Records in `kd_levels`: of the levels 0 to `KD_WORD_DEPTH`, and of the one below.
#define KD_LEVEL_RECORDS 34u
// Value of `KdCell.axis`: the cell becomes a leaf.
#define KD_NO_AXIS 3u
// `KdBuild.n_triangles` and all other numbers of entries stay below this, so that a word holds a node and a scale.
#define KD_MOST_ENTRIES 67108864u

// The state of a kd-tree's build. The host writes it before the build and reads it afterwards.
struct KdBuild {
    // The root's cell, and the margin of a triangle of scale 0 (world units).
    vec3 box_min;
    float margin;
    vec3 box_max;
    // The largest coordinate of all triangles (world units).
    float largest;
    // The bounds of the finite triangles as integers of the floats' order, the number of these triangles, and the
    // number of all triangles.
    uint least_x;
    uint least_y;
    uint least_z;
    uint n_finite;
    uint greatest_x;
    uint greatest_y;
    uint greatest_z;
    uint n_triangles;
    // The options. empty_factor: on the weight of a split with an empty side. max_depth: the most levels below the
    // root.
    float traversal_cost;
    float intersection_cost;
    float empty_factor;
    uint max_depth;
    // Capacities: references of a level and entries of all leaves, pairs of nodes, and cells of a level.
    uint max_references;
    uint max_pairs;
    uint max_cells;
    // The finest scale of the tree.
    uint finest;
    // The index in scan_blocks at which groups of cells begin. Blocks of references begin at 0.
    uint cell_groups_begin;
    // Cells that became leaves because their children would have passed a capacity.
    uint n_limited;
    // Entries of all leaves, and pairs of nodes, the root's included.
    uint n_entries;
    uint n_pairs;
    // The deepest level.
    uint depth;
    // Blocks of triangles whose sums are written.
    uint n_summed_blocks;
    // Workgroups over the pairs, and over the entries.
    uint pair_groups_x;
    uint pair_groups_y;
    uint pair_groups_z;
    uint entry_groups_x;
    uint entry_groups_y;
    uint entry_groups_z;
};

// A level of a kd-tree's build. Without open cells, its numbers of cells, references and workgroups are 0.
struct KdLevel {
    // Cells and references of the level.
    uint n_cells;
    uint n_references;
    // Of all levels above: references in leaves, and pairs of nodes, those of this level's nodes included.
    uint n_closed;
    uint n_pairs;
    // The first cell that is not split for lack of capacity, 0xffffffff if there is none. All cells after it become
    // leaves, too.
    uint cutoff;
    // References of the level below and above their cells' planes.
    uint n_below;
    uint n_above;
    // Blocks of references, and groups of cells, whose sums are written.
    uint n_summed_blocks;
    uint n_summed_groups;
    // Bits that tell which sizes the cells' children have (kdtree_count_cells.comp).
    uint child_sizes;
    // Workgroups over blocks of references that are counted by bins, over `KD_CHOOSE_BLOCK` references each, over
    // groups of references if there are small cells, over blocks and over groups of references, and over groups of
    // cells.
    uint bin_groups_x;
    uint bin_groups_y;
    uint bin_groups_z;
    uint choose_groups_x;
    uint choose_groups_y;
    uint choose_groups_z;
    uint small_groups_x;
    uint small_groups_y;
    uint small_groups_z;
    uint block_groups_x;
    uint block_groups_y;
    uint block_groups_z;
    uint reference_groups_x;
    uint reference_groups_y;
    uint reference_groups_z;
    uint cell_groups_x;
    uint cell_groups_y;
    uint cell_groups_z;
};

// A reference of a kd-tree's build: a triangle in a cell, and the bounds of its piece there, grown by its margin
// (`Reference` in src/accel/bounds.rs). `cell_ix` is among the cells of the level.
struct KdReference {
    vec3 box_min;
    uint triangle_ix;
    vec3 box_max;
    uint cell_ix;
};

// An open cell of a kd-tree's build.
struct KdCell {
    vec3 box_min;
    // The cell's first reference and the number of its references.
    uint first;
    vec3 box_max;
    uint n_references;
    // Index in `built_nodes`.
    uint node_ix;
    // The split: `KD_NO_AXIS` and any position for a leaf.
    uint axis;
    float position;
    // References of the children, and what is added to the number of references below (above) the planes that come
    // before one, to find its place in the next level.
    uint n_below;
    uint n_above;
    uint below_offset;
    uint above_offset;
    // Of all cells of the level before: splits, children with references, and references in leaves.
    uint splits_before;
    uint open_before;
    uint in_leaves_before;
    uint reserved0;
    uint reserved1;
};

// Push constants of a kd-tree's build.
struct KdStage {
    uint level_ix;
};

// Push constants of the kernels that relocate a structure: where its arrays begin among those of all structures.
//
// - `first_element`: the index of a kd-tree's first node, which is even, or of a grid's first cell.
// - `first_entry`: the index of the first entry of its leaves or cells. `first_row`: that of its first triangle.
struct StructurePlace {
    uint first_element;
    uint first_entry;
    uint first_row;
};

// Slabs of a kd-tree, computed on a device (src/passes/kd_slabs.rs). kdtree/slab_build.glsl defines the terms.

// The most entries below a node that gets a slab.
#define KD_SLAB_MAX_ENTRIES 2048u
// The most entries of a candidate whose normal one invocation computes. A workgroup computes that of a larger one.
#define KD_SLAB_SMALL 32u
// The most workgroups that compute normals of larger candidates. Each goes through several candidates if there are
// more.
#define KD_SLAB_GROUPS 2048u

// What the kernels that compute slabs need to know of a tree, 48 bytes.
//
// - `box_min`, `box_max`: the root's cell (world units). `n_nodes`, `n_entries`: of the tree.
// - `largest`, `margin`, `finest_scale`: the tree's scales (src/accel/kdtree/scales.rs).
struct KdSlabTree {
    vec3 box_min;
    uint n_nodes;
    vec3 box_max;
    uint n_entries;
    float largest;
    float margin;
    uint finest_scale;
    uint reserved;
};

// The state of the computation of slabs: workgroups of the dispatches over nodes and over entries, and the number of
// candidates with more than `KD_SLAB_SMALL` entries.
struct KdSlabBuild {
    uint node_groups_x;
    uint node_groups_y;
    uint node_groups_z;
    uint entry_groups_x;
    uint entry_groups_y;
    uint entry_groups_z;
    uint n_large;
};

// The surface below a node: a leaf with entries, or a candidate for a slab. 48 bytes.
//
// - `cell_min`, `cell_max`: the node's cell (world units).
// - `above`: the next candidate on the way to the root, or 0xffffffff.
// - `normal`: of a candidate's surface; of unit length, or 0 if the surface has no area.
struct KdSlabPatch {
    vec3 cell_min;
    uint above;
    vec3 cell_max;
    uint reserved0;
    vec3 normal;
    uint reserved1;
};

// How far a candidate's surface reaches along its normal, from the centre of its cell. The floats are stored as
// integers of the same order (`ordered`). `scale`: the coarsest scale of its triangles.
struct KdSlabExtent {
    uint low;
    uint high;
    uint scale;
};

// Bindings of the frame's descriptor set. scene_arrays.glsl has those of the scene's arrays. Below, "rays" are the
// `Frame.queue_capacity` rays of the queue, and "pixels" are the window's, rows from the top.

// One `Frame`.
#define BIND_FRAME 0u
// One `Material` for each material of the scene.
#define BIND_MATERIALS 3u
// `Frame.n_lights` of `Light`.
#define BIND_LIGHTS 4u
// One `PathRay` for each ray, bounce after bounce. The camera's rays are not stored, except in frames of paths.
#define BIND_RAYS 8u
// A word for each ray: bits of `CHILD_REFLECTED` and its like. In frames of paths, it is `PATH_GOES_ON` and
// `PATH_HAS_SHADOW_RAY`.
#define BIND_CHILD_FLAGS 9u
// A word for each ray: the index of its first child in the queue. A ray without children has the index that a child
// of it would have.
#define BIND_FIRST_CHILDREN 10u
// A word for each block of `SCAN_GROUP_SIZE` rays: the number of the block's children. After the scan, it is the
// number of the children of all blocks before. In frames of paths, each block has two words: the number of paths that
// go on, and the number of shadow rays.
#define BIND_SCAN_BLOCKS 11u
// One `Bounce` for each batch and bounce.
#define BIND_BOUNCES 12u
// One `Hit` for each ray.
#define BIND_HITS 13u
// A word for each light and ray, at `light * queue_capacity + ray`: `LIGHT_UNTESTED` and its like.
#define BIND_LIGHT_VISIBILITY 14u
// A vec4 for each ray: its radiance, weighted by its throughput.
#define BIND_RAY_RADIANCE 15u
// A vec4 for each pixel: the sample's radiance, or the mean of all samples. In frames of paths, it is first the sum of
// the frame's samples, and w has the same of the samples' squared luminance. If the picture has layers of light or of
// surfaces, as many elements follow for each of the `LIGHT_LAYERS` layers, then for each of the `SURFACE_LAYERS`.
#define BIND_PIXEL_RADIANCE 16u
// A vec4 for each pixel: the radiance after noise reduction. With the filter `edge`, as many elements follow: the light
// on surfaces, and in w the variance of its luminance, between two iterations of the filter.
#define BIND_PIXEL_FILTERED 17u
// A word for each pixel: what is displayed, 8 bits a channel, R in the lowest byte.
#define BIND_PIXEL_DISPLAY 18u
// The visibility buffer, an R32_UINT image: the index of the triangle that each pixel of the picture shows.
#define BIND_TRIANGLE_IDS 19u
// `COUNTER_COPIES` of `Counters` for each batch and bounce, `COUNTER_STRIDE` elements apart.
#define BIND_COUNTERS 20u
// A vec4 for each element of `pixel_radiance`: the sum of its samples' radiance. Frames of paths have several such
// sums, one after the other (path_accumulate.comp).
#define BIND_PIXEL_ACCUMULATED 24u
// One `PixelAovs` for each pixel.
#define BIND_PIXEL_AOVS 25u
// One `AccelConstants`.
#define BIND_ACCEL 26u
// Two words for each pixel: index of the nearest triangle, and above it the bits of its distance.
#define BIND_PIXEL_NEAREST 28u
// One `RasterGroups`, counts, and one `LargeTriangle` for each triangle of the scene.
#define BIND_RASTER_GROUPS 29u
// A row of counts, then `SUSPENDED_RAY_ROWS` rows of four words for each slot (search/suspended_rays.glsl).
#define BIND_SUSPENDED_RAYS 32u

// Bindings that only frames of paths have. `rays`, `hits`, `path_states`, `shadow_rays` and `path_snapshots` have an
// element for each path of a batch: all samples of the first pixel, then those of the second one, and so on.

// One `PathState` for each path.
#define BIND_PATH_STATES 33u
// One `ShadowRay` for each path.
#define BIND_SHADOW_RAYS 34u
// Three lists of `Frame.queue_capacity` words, each of indices of paths in their order. The first two lists have the
// paths that are alive: the first one at bounces of even depth, the second one at those of odd depth. The third list
// has the paths whose shadow rays are to be traced.
#define BIND_LIVE_PATHS 35u
// One `Auxiliary` for each pixel.
#define BIND_PIXEL_AUX 36u
// A vec4 for each path: its radiance when the last layer of light was complete. Empty unless the picture has layers of
// light.
#define BIND_PATH_SNAPSHOTS 37u
// A word for each of `MOST_NOISE_TILES` noise tiles (rays/noise_tiles.glsl).
#define BIND_NOISE_TILES 38u

// The scene's arrays as texels: the binding of each is this plus its own. All other bindings are below it.
#define BIND_TEXELS 64u

// Bindings of a cast's descriptor set, which also has those that the traversal reads: the scene's arrays,
// `BIND_ACCEL` and `BIND_SUSPENDED_RAYS`.

// One `Ray` for each ray of the cast.
#define BIND_CAST_RAYS 62u
// One `Hit` for each ray of the cast, or for each point.
#define BIND_CAST_HITS 63u
// One `QueryPoint` for each point, in place of `BIND_CAST_RAYS`.
#define BIND_CAST_POINTS 59u

// One `HitCursor` for each ray whose hits are counted or listed.
#define BIND_HIT_CURSORS 60u
// One `Hit` for each hit that is listed, those of a ray after those of the ray before.
#define BIND_LISTED_HITS 61u

// The descriptor set of a grid's build. "Level" is the level that is built. A "scan block" is `GRID_BLOCK_SIZE`
// consecutive entries. A "block of cells" is the lower cells that an upper cell is cut into.

// One `GridBuild`.
#define BIND_GRID_BUILD 40u
// The scene's triangles.
#define BIND_GRID_TRIANGLES 41u
// The upper level's pairs of a cell's and a triangle's index, two words each.
#define BIND_GRID_UPPER_PAIRS 42u
// A word for each item of the level: its first column, counted from the first one of its scan block.
#define BIND_GRID_FIRST_COLUMNS 43u
// The sum of each scan block; after the scan, the sum of all scan blocks before it.
#define BIND_GRID_SCAN_BLOCKS 44u
// The pairs that a kernel reads, two words each.
#define BIND_GRID_PAIRS_FROM 45u
// The pairs that a kernel writes, two words each.
#define BIND_GRID_PAIRS_TO 46u
// One `GridCell` for each cell.
#define BIND_GRID_CELLS 47u
// Two words for each upper cell, which describe its block of cells: the first lower cell, counted from the first one
// of the upper cell's scan block, and the number of lower cells along each axis.
#define BIND_GRID_BLOCKS 48u
// One `LeafTriangle` for each pair.
#define BIND_GRID_LEAF_TRIANGLES 49u
// One `Plane` for each pair.
#define BIND_GRID_LEAF_PLANES 50u
// A word for each column: its first pair, counted from the first one of its scan block.
#define BIND_GRID_FIRST_PAIRS 51u

// The descriptor set of a kd-tree's build. These bindings are above those of texels. A "block" is `KD_BLOCK_SIZE`
// consecutive entries. "From" is the level that is built, "to" the one below.

// One `KdBuild`.
#define BIND_KD_BUILD 128u
// `KD_LEVEL_RECORDS` of `KdLevel`.
#define BIND_KD_LEVELS 129u
// The triangles.
#define BIND_KD_TRIANGLES 130u
// `KD_SCALES` words: the number of triangles that need each scale.
#define BIND_KD_SCALE_COUNTS 131u
// One `KdReference` for each reference of the level.
#define BIND_KD_REFERENCES_FROM 132u
#define BIND_KD_REFERENCES_TO 133u
// For each reference that its cell's plane cuts: the piece above. The piece below replaces the reference itself.
#define BIND_KD_ABOVE 134u
// One `KdCell` for each open cell of the level.
#define BIND_KD_CELLS_FROM 135u
#define BIND_KD_CELLS_TO 136u
// A word for each reference of the level: how many of its block before it are below planes (10 bits) and above (10
// bits), and whether it is itself (bit 20, bit 21).
#define BIND_KD_SIDES 137u
// Four words for each block of triangles or references, and then for each block of cells: its sums; after the scan,
// the sums of all blocks before it.
#define BIND_KD_SCAN_BLOCKS 138u
// `KD_BIN_WORDS` for each large cell of the level, which is numbered by its first reference / `KD_BIN_BLOCK`.
#define BIND_KD_BINS 139u
// One `KdNode` for each node, pairs in the order of their levels. The children of a split are given by their pair in
// this order; the entries of a leaf begin in `leaf_references`.
#define BIND_KD_BUILT_NODES 140u
// A word for each pair of built nodes: its parent's index among them.
#define BIND_KD_BUILT_PARENTS 141u
// Two words for each built node: pairs and entries below it.
#define BIND_KD_BELOW 142u
// Two words for each built node: its children's pair and its first entry in the finished tree. Before these are found,
// the first word of a pair of two splits counts those that `kdtree_sum` has finished.
#define BIND_KD_PLACES 143u
// Two words for each reference in a leaf, in the order in which leaves are made: the triangle; the built node (27
// bits) and the scale of its cell.
#define BIND_KD_LEAF_REFERENCES 144u
// The finished tree: its nodes, their parents, and for each entry of a leaf a `LeafTriangle` and a `Plane`.
#define BIND_KD_NODES 145u
#define BIND_KD_PARENTS 146u
#define BIND_KD_LEAF_TRIANGLES 147u
#define BIND_KD_LEAF_PLANES 148u

// The descriptor set of the kernels that compute a kd-tree's slabs. These bindings are above those of texels.

// One `KdSlabTree`.
#define BIND_KD_SLAB_TREE 192u
// One `KdSlabBuild`.
#define BIND_KD_SLAB_BUILD 193u
// The tree's nodes.
#define BIND_KD_SLAB_NODES 194u
// A word for each pair of nodes: their parent.
#define BIND_KD_SLAB_PARENTS 195u
// One `LeafTriangle` for each entry.
#define BIND_KD_SLAB_LEAF_TRIANGLES 196u
// Two words for each node: the first of the entries below it, and their number.
#define BIND_KD_SLAB_RANGES 197u
// A word for each entry: its leaf, or 0xffffffff if the leaf has more than `KD_SLAB_MAX_ENTRIES` entries.
#define BIND_KD_SLAB_ENTRY_LEAVES 198u
// One `KdSlabPatch` for each node.
#define BIND_KD_SLAB_PATCHES 199u
// One `KdSlabExtent` for each node.
#define BIND_KD_SLAB_EXTENTS 200u
// A vec4 for each entry: the area vector of the piece of its triangle near its leaf (scaled units), and 0.
#define BIND_KD_SLAB_AREAS 201u
// A word for each candidate with more than `KD_SLAB_SMALL` entries: its node, in any order.
#define BIND_KD_SLAB_LARGE 202u
// One `Slab` for each node.
#define BIND_KD_SLAB_SLABS 203u

// A mesh that is deformed: the push constants of the kernels that do it.
//
// - `n_vertices`, `n_faces`: their numbers.
// - `n_influences`: the number of influences of each vertex. 0 if no joint moves the mesh.
// - `has_tangents`: 1 if tangents are deformed, too, or else 0.
// - `first_row`: the row of the triangles to which the first face is written.
// - `first_corner_word`: the index in `texture_words` of the `CornerSurface` of that row's first corner. `NO_WORDS`: no
//   tangents are written.
struct DeformMesh {
    uint n_vertices;
    uint n_faces;
    uint n_influences;
    uint has_tangents;
    uint first_row;
    uint first_corner_word;
};

// A vertex of a mesh at rest, 48 bytes.
//
// - `position`, `normal`: unit length, or zero if there is no normal.
// - `first_delta`, `n_deltas`: the first of its elements of `morph_deltas`, and their number.
// - `tangent`: unit length, or zero if there is none. `side`: 1 or -1, the side of the bitangent.
struct RestVertex {
    vec3 position;
    uint first_delta;
    vec3 normal;
    uint n_deltas;
    vec3 tangent;
    float side;
};

// What a morph target adds to a vertex, 48 bytes. `target` is the index of its weight.
struct MorphDelta {
    vec3 position;
    uint target;
    vec3 normal;
    uint reserved_0;
    vec3 tangent;
    uint reserved_1;
};

// A joint's share in the place of a vertex.
struct JointInfluence {
    uint joint;
    float weight;
};

// The transform by a joint, 48 bytes: a point p at rest goes to p.x `axis_x` + p.y `axis_y` + p.z `axis_z` +
// (`translation_x`, `translation_y`, `translation_z`).
struct JointRow {
    vec3 axis_x;
    float translation_x;
    vec3 axis_y;
    float translation_y;
    vec3 axis_z;
    float translation_z;
};

// A deformed vertex: its position, and its normal as in `Triangle`.
struct DeformedVertex {
    vec3 position;
    uint normal;
};

// The descriptor set of the kernels that deform a mesh. These bindings are above those of texels.

// One `RestVertex` for each vertex.
#define BIND_DEFORM_VERTICES 224u
// The `MorphDelta` of all vertices.
#define BIND_DEFORM_DELTAS 225u
// `n_influences` of `JointInfluence` for each vertex.
#define BIND_DEFORM_INFLUENCES 226u
// One `JointRow` for each joint.
#define BIND_DEFORM_JOINTS 227u
// A float for each morph target: its weight.
#define BIND_DEFORM_WEIGHTS 228u
// One `DeformedVertex` for each vertex.
#define BIND_DEFORM_DEFORMED 229u
// A word for each vertex: its tangent as in `CornerSurface`.
#define BIND_DEFORM_TANGENTS 230u
// Three words for each face: its vertices.
#define BIND_DEFORM_FACES 231u
// The world's triangles.
#define BIND_DEFORM_TRIANGLES 232u
// The world's `texture_words`.
#define BIND_DEFORM_TEXTURE_WORDS 233u

#endif
