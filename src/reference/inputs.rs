//! The data that kernels only read, under the kernels' names.

use glam::Vec3;

use super::alpha_test::fails_alpha_test;
use super::counting::table::{Counted, CountedSlice, NoCounter, ReadCounts};
use super::triangle::Shear;
use crate::{
    accel::{
        Accel,
        grid::{Grid, Lattice},
        kdtree::{KdTree, TraversalLinks},
        two_level::TwoLevel,
    },
    layout::{
        AccelConstants, Frame, GridCell, Hit, INSTANCE_FOR_CAMERA, INSTANCE_FOR_OTHERS, INSTANCE_FOR_SHADOWS,
        INSTANCE_MASK_SHIFT, Instance, KdBox, KdNode, KdRope, Light, Material, Plane, Slab, TRIANGLE_HIDDEN, Triangle,
    },
    world::{Emitters, Geometry, Instances, Textures, World, instances::Stored},
};

/// The scene, its acceleration structure and the frame's constants. `R` counts reads of the structure.
#[derive(Clone, Copy, Debug, Default)]
pub struct KernelInputs<'a, R = NoCounter> {
    /// The frame's constants; `None` for rays that do not belong to a frame.
    pub frame: Option<&'a Frame>,
    /// The places of the noise tiles of which the window consists; empty if it is a rectangle of the picture.
    pub noise_tiles: &'a [u32],
    /// Least corner of the box that holds all triangles, with the structure's rounding margin (world units).
    pub box_min: Vec3,
    /// Greatest corner of this box.
    pub box_max: Vec3,
    /// The limit of the coordinates of a ray's origin, world units. Origins beyond it are moved (`near_scene`).
    pub origin_reach: f32,
    pub triangles: &'a [Triangle],
    /// One word for each triangle: an index into `materials`, or with `filters`, `TRIANGLE_HIDDEN` or 0.
    pub triangle_materials: &'a [u32],
    /// Whether rays pass through triangles with `TRIANGLE_HIDDEN`.
    pub filters: bool,
    pub materials: &'a [Material],
    /// The scene's textures; `None` if it has none.
    pub textures: Option<&'a Textures>,
    /// The textures if some of them cut out parts of triangles.
    pub alpha_masks: Option<&'a Textures>,
    /// The textures if rays of paths pass through some triangles.
    pub path_alpha_test: Option<&'a Textures>,
    /// Whether rays pass through blended surfaces with an opacity below `LEAST_SHADOWING_OPACITY`.
    pub tests_blended: bool,
    /// Whether rays pass through blended surfaces at random, as often as their opacity says.
    pub stochastic_alpha: bool,
    /// Whether the rays are the camera's.
    pub is_of_camera: bool,
    /// Whether rays pass through the back faces of single-sided materials, as camera rays do.
    pub culls_back_faces: bool,
    pub lights: &'a [Light],
    /// What the path tracer samples lights from; `None` for rays that do not belong to a frame.
    pub emitters: Option<&'a Emitters>,
    pub kd_nodes: CountedSlice<'a, KdNode, R>,
    /// For each pair of siblings, the index of their parent.
    pub kd_parents: CountedSlice<'a, u32, R>,
    /// The entries of leaves or of a grid's cells. Each is an index into `triangles`. (The kernels' array
    /// of this name holds a `LeafTriangle` for each entry.)
    pub leaf_triangles: CountedSlice<'a, u32, R>,
    /// One for each entry of `leaf_triangles`, or none at all.
    pub leaf_planes: &'a [Plane],
    /// One for each node, or none at all.
    pub kd_slabs: CountedSlice<'a, Slab, R>,
    /// One for each node, or none at all if the traversal does not use them.
    pub kd_boxes: CountedSlice<'a, KdBox, R>,
    /// Six for each node, or none at all if the traversal does not use them.
    pub kd_ropes: CountedSlice<'a, KdRope, R>,
    /// The lattice of a grid's upper cells; `None` for a kd-tree, and outside of instances.
    pub lattice: Option<&'a Lattice>,
    /// The cells of a grid (see [`Grid::cells`]); empty for a kd-tree.
    pub grid_cells: CountedSlice<'a, GridCell, R>,
    /// The levels of a grid's cells, 1 or 2; 0 for a kd-tree.
    pub n_grid_levels: u32,
    /// The instances of which the world consists; `None` if it is flat.
    pub instanced: Option<Instanced<'a>>,
    /// The bits of [`Instance::flags`] of which rays that are neither the camera's nor shadow rays want one.
    pub other_rays: u32,
    /// The instance whose geometry is searched: the arrays of the structure, `box_min`, `box_max`, `origin_reach` and
    /// `triangles` are the geometry's, and the indices of triangles are those within it.
    pub inside: Option<&'a Instance>,
}

/// The instances of a world, and their structure.
#[derive(Clone, Copy, Debug)]
pub struct Instanced<'a> {
    pub instances: &'a Instances,
    pub two: &'a TwoLevel,
}

impl<'a, R: Copy> KernelInputs<'a, R> {
    /// Returns the inputs of the search through an instance's geometry.
    pub fn of_instance(&self, Instanced { instances, two }: &Instanced<'a>, instance: &'a Instance) -> Self {
        let geometry_ix = instance.geometry_ix as usize;
        let structure = &*two.structures()[geometry_ix];
        let nodes = two.node_begins()[geometry_ix]..two.node_begins()[geometry_ix + 1];
        let constants = structure.constants();
        Self {
            box_min: constants.box_min,
            box_max: constants.box_max,
            origin_reach: constants.origin_reach,
            triangles: instances.ranges[geometry_ix].of(self.triangles),
            kd_nodes: self.kd_nodes.with_items(structure.nodes()),
            kd_parents: self.kd_parents.with_items(structure.parents()),
            leaf_triangles: self.leaf_triangles.with_items(structure.leaf_triangles()),
            leaf_planes: structure.leaf_planes(),
            kd_slabs: self.kd_slabs.with_items(structure.slabs()),
            kd_boxes: self.kd_boxes.slice(nodes.clone()),
            kd_ropes: self.kd_ropes.slice(6 * nodes.start..6 * nodes.end),
            lattice: structure.as_grid().map(Grid::lattice),
            grid_cells: self.grid_cells.with_items(structure.cells()),
            inside: Some(instance),
            ..*self
        }
    }
}

impl<'a, R> KernelInputs<'a, R> {
    /// The frame's constants.
    ///
    /// # Panics
    /// The rays do not belong to a frame.
    #[inline(always)]
    pub fn frame(&self) -> &'a Frame {
        self.frame.expect("rays of a frame")
    }

    /// Returns whether a hit counts: rays pass through hidden triangles, where the alpha test fails, and those of the
    /// camera through back faces. `shear` is the ray's.
    #[inline(always)]
    pub fn is_accepted(&self, shear: &Shear, hit: &Hit, alpha_seed: u32) -> bool {
        (!self.culls_back_faces || !self.is_culled(shear, hit))
            && (!self.lets_rays_pass() || self.is_solid_at(hit, alpha_seed))
    }

    /// Returns a hit of the search through a geometry as one of the world.
    #[inline(always)]
    pub fn in_world(&self, hit: &Hit) -> Hit {
        let Some(instance) = self.inside else { return *hit };
        let (u, v) = if instance.is_mirrored() { (hit.v, hit.u) } else { (hit.u, hit.v) };
        Hit { triangle_ix: instance.first_triangle + hit.triangle_ix, u, v, ..*hit }
    }

    /// Returns where a triangle of the world is stored.
    #[inline(always)]
    pub fn stored(&self, triangle_ix: u32) -> Stored<'a> {
        match (self.instanced, self.inside) {
            (None, _) => Stored { row: triangle_ix as usize, instance: None },
            (Some(instanced), None) => instanced.instances.stored(triangle_ix as usize),
            (Some(_), Some(instance)) => instance.stored(triangle_ix),
        }
    }

    /// Returns a triangle of the world.
    #[inline(always)]
    pub fn triangle(&self, triangle_ix: u32) -> Triangle {
        let Stored { row, instance } = self.stored(triangle_ix);
        instance.map_or(self.triangles[row], |it| it.triangle(&self.triangles[row]))
    }

    /// Returns the corners, in the world, of a triangle of the structure that is searched.
    pub(super) fn corners(&self, triangle_ix: u32) -> [Vec3; 3] {
        let t = &self.triangles[triangle_ix as usize];
        let corners = [t.v0, t.v1, t.v2];
        let Some(instance) = self.inside else { return corners };
        Stored { row: 0, instance: Some(instance) }.corners(corners.map(|corner| instance.point(corner)))
    }

    /// Returns the index of the material of a triangle of the world.
    #[inline(always)]
    pub fn material_ix_of(&self, triangle_ix: u32) -> u32 {
        let Stored { row, instance } = self.stored(triangle_ix);
        match (instance, self.instanced) {
            (Some(it), Some(all)) => {
                all.instances.materials[(it.first_material + self.triangle_materials[row]) as usize]
            }
            _ => self.triangle_materials[row],
        }
    }

    /// Returns the kind of the rays: bits of [`Instance::flags`], of which an instance that they meet has one.
    pub(super) fn kind_of_rays(&self, any_hit: bool) -> u32 {
        match self.tests_blended && any_hit {
            _ if self.is_of_camera => INSTANCE_FOR_CAMERA,
            true => INSTANCE_FOR_SHADOWS,
            false => self.other_rays,
        }
    }

    /// Returns whether rays pass from behind through the triangle of a hit of the search.
    #[inline(always)]
    pub fn passes_from_behind(&self, triangle_ix: u32) -> bool {
        self.culls_back_faces && self.is_single_sided(triangle_ix)
    }

    fn is_single_sided(&self, triangle_ix: u32) -> bool {
        let triangle_ix = self.inside.map_or(triangle_ix, |it| it.first_triangle + triangle_ix);
        self.materials[self.material_ix_of(triangle_ix) as usize].is_single_sided()
    }

    fn is_culled(&self, shear: &Shear, hit: &Hit) -> bool {
        self.passes_from_behind(hit.triangle_ix) && shear.is_back_face(&self.triangles[hit.triangle_ix as usize])
    }

    /// Returns whether parts of triangles may let a ray pass, from both sides.
    #[inline(always)]
    pub fn lets_rays_pass(&self) -> bool {
        self.filters || self.alpha_masks.is_some()
    }

    #[cold]
    pub fn is_solid_at(&self, hit: &Hit, alpha_seed: u32) -> bool {
        let hit = &self.in_world(hit);
        match self.alpha_masks {
            Some(textures) => {
                let (at, material_ix) = (self.stored(hit.triangle_ix), self.material_ix_of(hit.triangle_ix));
                let alpha_seed = self.stochastic_alpha.then_some(alpha_seed);
                !fails_alpha_test(textures, material_ix, (hit, &at), self.tests_blended, alpha_seed)
            }
            None => self.triangle_materials[hit.triangle_ix as usize] & TRIANGLE_HIDDEN == 0,
        }
    }
}

impl<'a> KernelInputs<'a> {
    /// The inputs of a frame's kernels.
    pub fn new(world: &'a World, frame: &'a Frame) -> Self {
        let scene = world.scene();
        Self {
            triangle_materials: &scene.triangle_materials,
            materials: &scene.materials,
            textures: scene.textures.is_in_use().then_some(&scene.textures),
            alpha_masks: scene.textures.has_shadow_alpha_test().then_some(&scene.textures),
            path_alpha_test: scene.textures.has_path_alpha_test().then_some(&scene.textures),
            lights: &scene.lights,
            frame: Some(frame),
            ..Self::of_geometry(world.geometry())
        }
    }

    /// The inputs of a search, without materials and lights. If devices build the structure, the host builds it,
    /// too, unless it has done so already.
    pub fn of_geometry(geometry: Geometry<'a>) -> Self {
        let triangles = geometry.triangles();
        match geometry.accel() {
            Accel::KdTree(tree) => Self::of_tree(triangles, tree),
            Accel::LazyTree(tree) => Self::of_tree(triangles, tree.get(triangles)),
            Accel::Grid(grid) => Self::of_grid(triangles, grid.get(triangles)),
            Accel::TwoLevel(two) => {
                two.build_on_host(triangles);
                let [box_min, box_max] = two.bounds();
                let origin_reach = two.origin_reach();
                let constants = AccelConstants { box_min, box_max, origin_reach, ..AccelConstants::default() };
                let instanced = geometry.instances().map(|instances| Instanced { instances, two });
                let n_grid_levels = two.n_grid_levels();
                Self { instanced, n_grid_levels, ..Self::without_accel(triangles, &constants) }
            }
        }
    }

    /// The inputs of the traversal of a kd-tree, without materials and lights, boxes and ropes.
    pub fn of_tree(triangles: &'a [Triangle], tree: &'a KdTree) -> Self {
        Self {
            kd_nodes: CountedSlice::from(tree.nodes()),
            kd_parents: CountedSlice::from(tree.parents()),
            leaf_triangles: CountedSlice::from(tree.leaf_triangles()),
            leaf_planes: tree.leaf_planes(),
            kd_slabs: CountedSlice::from(tree.slabs()),
            ..Self::without_accel(triangles, &tree.constants())
        }
    }

    /// The inputs of the search through a grid, without materials and lights.
    pub fn of_grid(triangles: &'a [Triangle], grid: &'a Grid) -> Self {
        Self {
            leaf_triangles: CountedSlice::from(grid.leaf_triangles()),
            leaf_planes: grid.leaf_planes(),
            lattice: Some(grid.lattice()),
            grid_cells: CountedSlice::from(grid.cells()),
            n_grid_levels: grid.n_levels(),
            ..Self::without_accel(triangles, &grid.constants())
        }
    }

    /// Inputs with the triangles and the constants of their structure. All other arrays are empty.
    fn without_accel(triangles: &'a [Triangle], constants: &AccelConstants) -> Self {
        Self {
            box_min: constants.box_min,
            box_max: constants.box_max,
            origin_reach: constants.origin_reach,
            triangles,
            other_rays: INSTANCE_FOR_OTHERS,
            ..Self::default()
        }
    }

    /// Returns the same inputs, with reads of the structure counted in `counts`.
    pub fn counted<'c>(self, counts: &'c ReadCounts) -> KernelInputs<'a, Counted<'c>> {
        KernelInputs {
            frame: self.frame,
            noise_tiles: self.noise_tiles,
            box_min: self.box_min,
            box_max: self.box_max,
            origin_reach: self.origin_reach,
            triangles: self.triangles,
            triangle_materials: self.triangle_materials,
            filters: self.filters,
            materials: self.materials,
            textures: self.textures,
            alpha_masks: self.alpha_masks,
            path_alpha_test: self.path_alpha_test,
            tests_blended: self.tests_blended,
            stochastic_alpha: self.stochastic_alpha,
            is_of_camera: self.is_of_camera,
            culls_back_faces: self.culls_back_faces,
            lights: self.lights,
            emitters: self.emitters,
            kd_nodes: self.kd_nodes.with_counter(Counted(&counts.n_nodes)),
            kd_parents: self.kd_parents.with_counter(Counted(&counts.n_links)),
            leaf_triangles: self.leaf_triangles.with_counter(Counted(&counts.n_triangles)),
            leaf_planes: self.leaf_planes,
            kd_slabs: self.kd_slabs.with_counter(Counted(&counts.n_nodes)),
            kd_boxes: self.kd_boxes.with_counter(Counted(&counts.n_boxes)),
            kd_ropes: self.kd_ropes.with_counter(Counted(&counts.n_links)),
            lattice: self.lattice,
            grid_cells: self.grid_cells.with_counter(Counted(&counts.n_nodes)),
            n_grid_levels: self.n_grid_levels,
            instanced: self.instanced,
            other_rays: self.other_rays,
            inside: self.inside,
        }
    }

    /// Returns the material of the triangle that was hit.
    ///
    /// # Panics
    /// Nothing was hit.
    pub fn material_at(&self, hit: &Hit) -> &'a Material {
        &self.materials[self.material_ix_of(hit.triangle_ix) as usize]
    }

    /// Returns the same inputs, but rays that are neither the camera's nor shadow rays meet the instances whose masks
    /// have a bit in common with this one.
    pub fn with_mask(self, mask: u8) -> Self {
        Self { other_rays: u32::from(mask) << INSTANCE_MASK_SHIFT, ..self }
    }

    /// Returns the same inputs, but rays pass through triangles whose word is `TRIANGLE_HIDDEN`. There is one word
    /// for each triangle.
    pub fn with_hidden(self, words: &'a [u32]) -> Self {
        Self { triangle_materials: words, filters: true, ..self }
    }

    /// Returns the inputs of shadow rays, which pass through blended surfaces with an opacity below
    /// `LEAST_SHADOWING_OPACITY`.
    pub fn with_blended_tested(self) -> Self {
        Self { tests_blended: true, ..self }
    }

    /// Returns the inputs of camera rays, which pass through the back faces of single-sided materials.
    pub fn of_camera(self) -> Self {
        let culls_back_faces = self.materials.iter().any(Material::is_single_sided);
        Self { is_of_camera: true, culls_back_faces, ..self }
    }

    /// Returns the inputs of paths: with the materials that [`path_materials`](crate::world::path_materials) returns,
    /// and the world's emitters.
    pub fn of_paths(self, materials: &'a [Material], emitters: &'a Emitters) -> Self {
        Self { materials, emitters: Some(emitters), ..self }
    }

    /// Returns the inputs of paths in a window of noise tiles, or with an empty slice, in a rectangle.
    pub fn with_noise_tiles(self, noise_tiles: &'a [u32]) -> Self {
        Self { noise_tiles, ..self }
    }

    /// Returns the inputs of paths, whose rays pass through blended surfaces at random, as often as their opacity
    /// says.
    pub fn with_stochastic_alpha(self) -> Self {
        Self { alpha_masks: self.path_alpha_test, tests_blended: true, stochastic_alpha: true, ..self }
    }

    /// Returns the same inputs with a kd-tree's boxes and ropes.
    pub fn with_links(self, links: &'a TraversalLinks) -> Self {
        Self { kd_boxes: CountedSlice::from(&*links.boxes), kd_ropes: CountedSlice::from(&*links.ropes), ..self }
    }
}
