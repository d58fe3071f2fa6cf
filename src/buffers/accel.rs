//! Buffers of the scene's triangles and their acceleration structure, which are a part of every descriptor set.

use std::sync::Arc;

use bytemuck::cast_slice;
use rayon::prelude::*;

use super::{
    SuspendedRays,
    device_structures::{DeviceStructures, with_room_for},
    geometries::{Arrays, Geometries},
    scene_arrays::{Content, Contents, SceneAccess, SceneArrays},
    structure_builder::builder_options,
    surface_features::SurfaceFeatures,
    texture_words::TextureWords,
    two_level::{Joined, instance_rows, leaf_triangle},
};
use crate::{
    accel::{
        Accel, AccelKind,
        grid::{Grid, LazyGrid},
        kdtree::{KdTree, LazyTree, Traversal, TraversalLinks},
        two_level::TwoLevel,
    },
    gpu::{Binding, Buffer, BufferUse, Constants, Context, GpuError, Timer},
    layout::{
        AccelConstants, BIND_ACCEL, BIND_SUSPENDED_RAYS, BRUTE_MAX_TRIANGLES, KD_WORD_DEPTH, KdRope, LeafTriangle,
        NO_WORDS, Slab, TRIANGLE_HIDDEN, Triangle, constants,
    },
    passes::{grid::GridBuilder, kdtree::KdTreeBuilder, structures::StructureArrays},
    world::{Emitters, Geometry, Instances, Poses, World},
};

/// Returns the numbers of the bindings of [`AccelBuffers`].
pub(super) fn bindings() -> impl Iterator<Item = u32> {
    [BIND_ACCEL, BIND_SUSPENDED_RAYS].into_iter().chain(SceneArrays::bindings())
}

/// Kind of acceleration structure, of the world or of each geometry, for which kernels are specialized.
#[derive(Clone, Copy)]
enum Structure {
    /// A kd-tree. `mask_words`: the number of words of the traversal's bit mask, 1 or 2.
    KdTree { mask_words: u32 },
    /// A grid. `n_levels`: the number of levels of cells, 1 or 2.
    Grid { n_levels: u32 },
}

/// Buffers of triangles, of their acceleration structure and of the constants of both. A clone is a second handle to
/// the same buffers.
#[derive(Clone)]
pub struct AccelBuffers {
    /// The constants: one element.
    constants: Buffer<AccelConstants>,
    pub arrays: SceneArrays,
    /// Rays that were suspended on their way through the structure.
    pub suspended_rays: SuspendedRays,
    access: SceneAccess,
    structure: Structure,
    /// Whether the triangles are those of geometries, with a hierarchy over their instances.
    pub is_instanced: bool,
    /// Whether `arrays` have the emitters, which only paths read.
    has_emitters: bool,
    /// The number of triangles in the world.
    pub n_triangles: usize,
    /// Whether rays pass through some of the triangles.
    filters: bool,
    surface_features: SurfaceFeatures,
    /// The contents of `constants`.
    uploaded: AccelConstants,
    /// Where the structures of geometries are; none unless the device has built some of them.
    structures: Option<Arc<DeviceStructures>>,
}

impl AccelBuffers {
    /// Uploads triangles and their structure.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn new(context: &Arc<Context>, geometry: Geometry) -> Result<Self, GpuError> {
        Self::with_room(context, geometry, 0)
    }

    /// Uploads the geometry and the surfaces of a scene.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn of_world(context: &Arc<Context>, world: &World, of_paths: bool) -> Result<Self, GpuError> {
        let scene = world.scene();
        let none = Emitters::default();
        let emitters = if of_paths { world.emitters() } else { &none };
        let words = TextureWords::new(&scene.textures, emitters);
        let mut made = Self::with_room(context, world.geometry(), words.len())?;
        made.add_materials(context, &scene.triangle_materials)?;
        made.add_words(context, &words)?;
        made.surface_features = SurfaceFeatures::of(scene);
        made.has_emitters = of_paths;
        Ok(made)
    }

    /// Returns buffers of the same scene for the other integrator. They share all arrays that serve both.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub(super) fn for_integrator(
        &self,
        context: &Arc<Context>,
        world: &World,
        of_paths: bool,
    ) -> Result<Self, GpuError> {
        let mut next = self.with_own_suspended_rays(context)?;
        if of_paths && !self.has_emitters {
            next.add_words(context, &TextureWords::new(&world.scene().textures, world.emitters()))?;
            next.has_emitters = true;
        }
        Ok(next)
    }

    /// Returns buffers that share all arrays, for kernels that may run at the same time: each has room of its own for
    /// the rays that are suspended.
    ///
    /// # Errors
    /// Memory runs out.
    pub fn with_own_suspended_rays(&self, context: &Arc<Context>) -> Result<Self, GpuError> {
        Ok(Self { suspended_rays: SuspendedRays::new(context)?, ..self.clone() })
    }

    /// Uploads triangles and their structure. `n_texture_words`: the length that `texture_words` will have.
    fn with_room(context: &Arc<Context>, geometry: Geometry, n_texture_words: usize) -> Result<Self, GpuError> {
        let triangles = geometry.triangles();
        let common = || Contents::of_triangles(triangles, n_texture_words);
        let mut made = match geometry.accel() {
            Accel::KdTree(tree) => Self::of_tree(context, triangles, tree, common()),
            Accel::LazyTree(tree) => match Self::of_device_tree(context, triangles, tree, common) {
                Err(error) if error.is_lack_of_room() => {
                    tracing::warn!("the host builds the kd-tree, since the device has too little room: {error}");
                    Self::of_tree(context, triangles, tree.get(triangles), common())
                }
                made => made,
            },
            Accel::Grid(grid) if GridBuilder::has_room(context, triangles.len()) => {
                Self::of_device_grid(context, triangles, grid, common())
            }
            Accel::Grid(grid) => Self::of_grid(context, triangles, grid.get(triangles), common()),
            Accel::TwoLevel(two) => {
                let instances = geometry.instances().expect("a structure of two levels is over instances");
                let all = Geometries { two, instances, geometry, poses: &Poses::default() };
                let of_host = || Self::of_two_level(context, triangles, (two, instances), common());
                match two.has_device_structures().then(|| Self::of_device_structures(context, &all, common)) {
                    Some(Err(error)) if error.is_lack_of_room() => {
                        let what = if two.n_grid_levels() > 0 { "grids" } else { "kd-trees" };
                        tracing::warn!("the host builds the {what}, since the device has too little room: {error}");
                        of_host()
                    }
                    Some(made) => made,
                    None => of_host(),
                }
            }
        }?;
        made.n_triangles = geometry.n_triangles();
        made.is_instanced = geometry.instances().is_some();
        Ok(made)
    }

    /// Uploads the triangles and the structures of all geometries, and the instances with their hierarchy.
    fn of_two_level(
        context: &Arc<Context>,
        triangles: &[Triangle],
        (two, instances): (&TwoLevel, &Instances),
        common: Contents,
    ) -> Result<Self, GpuError> {
        two.build_on_host(triangles);
        let joined = Joined::new(two, instances);
        joined.check()?;
        let mut constants = AccelConstants::default();
        let rows = instance_rows(two, instances, &two.host_places(), &mut constants);
        let (n_nodes, n_entries) = (joined.n_nodes(), joined.n_entries());
        let n_slabs = if context.predicates_branches() { 0 } else { joined.n_slabs() };
        let write_entries = |first: usize, chunk: &mut [LeafTriangle]| joined.write_entries(triangles, first, chunk);
        let contents = Contents {
            instance_rows: Content::Elements(&rows),
            kd_nodes: Content::Written { len: n_nodes, write: &|first, chunk| joined.write_nodes(first, chunk) },
            kd_parents: match context.loop_limit()? {
                Some(_) => {
                    Content::Written { len: n_nodes / 2, write: &|first, chunk| joined.write_parents(first, chunk) }
                }
                None => Content::Reserved(n_nodes / 2),
            },
            leaf_triangles: Content::Written { len: n_entries, write: &write_entries },
            leaf_planes: Content::Written { len: n_entries, write: &|first, chunk| joined.write_planes(first, chunk) },
            kd_slabs: Content::Written { len: n_slabs, write: &|first, chunk| joined.write_slabs(first, chunk) },
            kd_links: Content::Reserved(6 * n_nodes),
            grid_cells: Content::Written {
                len: joined.n_cells(),
                write: &|first, chunk| joined.write_cells(first, chunk),
            },
            ..common
        };
        let structure = match two.n_grid_levels() {
            0 => Structure::KdTree { mask_words: if two.depth() <= KD_WORD_DEPTH { 1 } else { 2 } },
            n_levels => Structure::Grid { n_levels },
        };
        Self::with(context, contents, &constants, structure)
    }

    /// Uploads the geometries, some of whose structures the device builds. `common`: returns the contents without a
    /// structure.
    fn of_device_structures<'a>(
        context: &Arc<Context>,
        all: &Geometries<'a>,
        common: impl Fn() -> Contents<'a>,
    ) -> Result<Self, GpuError> {
        let on_device = Buffer::with(context, "triangles", all.geometry.triangles(), BufferUse::Texels)?;
        let (structures, new) = DeviceStructures::build(context, &on_device, all)?;
        let mut constants = AccelConstants::default();
        let rows = instance_rows(all.two, all.instances, &structures.places(), &mut constants);
        let reserved = || Contents { instance_rows: Content::Elements(&rows), ..structures.reserved(common()) };
        let usage = SceneAccess::of(context, &reserved()).buffer_use();
        let arrays = structures.arrays(context, usage, (all, new))?;
        let contents = with_triangles(on_device, usage, with_structures(arrays, usage, reserved()));
        let structure = match all.two.n_grid_levels() {
            0 => Structure::KdTree { mask_words: 1 },
            n_levels => Structure::Grid { n_levels },
        };
        let made = Self::with(context, contents, &constants, structure)?;
        Ok(Self { structures: Some(Arc::new(structures)), ..made })
    }

    /// Uploads triangles and their kd-tree.
    fn of_tree(
        context: &Arc<Context>,
        triangles: &[Triangle],
        tree: &KdTree,
        common: Contents,
    ) -> Result<Self, GpuError> {
        let n_nodes = tree.nodes().len();
        let entries = tree.leaf_triangles();
        let write_entries = |first: usize, chunk: &mut [LeafTriangle]| leaf_triangles(triangles, entries, first, chunk);
        let contents = Contents {
            kd_nodes: Content::Elements(tree.nodes()),
            // Suspended rays go back to where they stopped by the parents.
            kd_parents: match context.loop_limit()? {
                Some(_) => Content::Elements(tree.parents()),
                None => Content::Reserved(tree.parents().len()),
            },
            leaf_triangles: Content::Written { len: entries.len(), write: &write_entries },
            leaf_planes: Content::Elements(tree.leaf_planes()),
            kd_slabs: Content::Elements(slabs_for(context, tree)),
            kd_links: Content::Reserved(6 * n_nodes),
            ..common
        };
        let mask_words = if tree.depth() <= KD_WORD_DEPTH { 1 } else { 2 };
        Self::with(context, contents, &tree.constants(), Structure::KdTree { mask_words })
    }

    /// Uploads triangles, whose kd-tree the device builds. `common`: returns the contents without a structure.
    fn of_device_tree<'a>(
        context: &Arc<Context>,
        triangles: &'a [Triangle],
        tree: &LazyTree,
        common: impl Fn() -> Contents<'a>,
    ) -> Result<Self, GpuError> {
        let on_device = Buffer::with(context, "triangles", triangles, BufferUse::Texels)?;
        let builder = KdTreeBuilder::new(context, &on_device, &builder_options(context, tree))?;
        let timer = Timer::new(context, builder.n_stages())?;
        let built = builder.build(Some(&timer))?;
        let reserved = || with_room_for(built.sizes(), built.kind(), common());
        let usage = SceneAccess::of(context, &reserved()).buffer_use();
        let arrays = builder.copy(&built, usage)?;
        drop(builder); // its memory is larger than the tree's
        tree.note(built.report(triangles.len()));
        let contents = with_triangles(on_device, usage, with_structures(arrays, usage, reserved()));
        Self::with(context, contents, &tree.constants(), Structure::KdTree { mask_words: 1 })
    }

    /// Uploads triangles, whose grid the device builds.
    fn of_device_grid(
        context: &Arc<Context>,
        triangles: &[Triangle],
        grid: &LazyGrid,
        common: Contents,
    ) -> Result<Self, GpuError> {
        let on_device = Buffer::with(context, "triangles", triangles, BufferUse::Texels)?;
        let builder = GridBuilder::new(context, &on_device, grid.options())?;
        let timer = Timer::new(context, builder.n_stages())?;
        let built = builder.build(Some(&timer))?;
        let arrays = builder.copy(&built, BufferUse::Texels)?;
        drop(builder); // its memory is larger than the grid's
        grid.note(built.report(triangles.len()));
        let constants = built.constants(grid.origin_reach());
        let structure = Structure::Grid { n_levels: built.n_levels };
        let contents = with_triangles(on_device, BufferUse::Texels, with_structures(arrays, BufferUse::Texels, common));
        Self::with(context, contents, &constants, structure)
    }

    /// Uploads triangles and the grid that the host has built. This is for scenes with more triangles than the device
    /// can bind as one storage buffer, since the kernels that build grids need that.
    fn of_grid(
        context: &Arc<Context>,
        triangles: &[Triangle],
        grid: &Grid,
        common: Contents,
    ) -> Result<Self, GpuError> {
        let entries = grid.leaf_triangles();
        let write_entries = |first: usize, chunk: &mut [LeafTriangle]| leaf_triangles(triangles, entries, first, chunk);
        let contents = Contents {
            grid_cells: Content::Elements(grid.cells()),
            leaf_triangles: Content::Written { len: entries.len(), write: &write_entries },
            leaf_planes: Content::Elements(grid.leaf_planes()),
            ..common
        };
        Self::with(context, contents, &grid.constants(), Structure::Grid { n_levels: grid.n_levels() })
    }

    /// Uploads the arrays. `constants`: all constants but the number of triangles and the arrays' addresses.
    fn with(
        context: &Arc<Context>,
        contents: Contents,
        constants: &AccelConstants,
        structure: Structure,
    ) -> Result<Self, GpuError> {
        let access = SceneAccess::of(context, &contents);
        let arrays = contents.upload(context, access)?;
        let n_triangles = arrays.triangles.len() as u32;
        let uploaded = AccelConstants {
            n_triangles,
            uvs_begin: NO_WORDS,
            corners_begin: NO_WORDS,
            material_maps_begin: NO_WORDS,
            textures_begin: NO_WORDS,
            emitters_begin: NO_WORDS,
            area_lights_begin: NO_WORDS,
            light_nodes_begin: NO_WORDS,
            environment_begin: NO_WORDS,
            ..*constants
        };
        let mut made = Self {
            constants: Buffer::new(context, "accel", 1, BufferUse::Uniform)?,
            arrays,
            suspended_rays: SuspendedRays::new(context)?,
            access,
            has_emitters: false,
            n_triangles: n_triangles as usize,
            filters: false,
            surface_features: SurfaceFeatures::default(),
            structure,
            is_instanced: false,
            uploaded,
            structures: None,
        };
        made.upload_constants(context)?;
        Ok(made)
    }

    /// Uploads the index of each triangle's material, which a cast does not need. Descriptor sets over these buffers
    /// have to be made again.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub(super) fn add_materials(&mut self, context: &Arc<Context>, triangle_materials: &[u32]) -> Result<(), GpuError> {
        let materials = Content::Elements(triangle_materials);
        self.arrays.triangle_materials = materials.upload(context, "triangle_materials", self.access)?;
        self.upload_constants(context)
    }

    /// Uploads textures and emitters, and notes where their arrays begin.
    fn add_words(&mut self, context: &Arc<Context>, words: &TextureWords) -> Result<(), GpuError> {
        let content = Content::Written { len: words.len(), write: &|first, chunk| words.write(first, chunk) };
        self.arrays.texture_words = content.upload(context, "texture_words", self.access)?;
        words.note_begins(&mut self.uploaded);
        self.upload_constants(context)
    }

    /// Uploads the arrays that the traversal reads beside the structure; for a grid there are none. `geometry`: that
    /// is uploaded. Clones of these buffers keep their own arrays. Descriptor sets over these buffers
    /// have to be made again.
    ///
    /// # Errors
    /// There are too many triangles for brute force, a buffer is beyond the device's limits, or memory runs out.
    /// Nothing has changed then.
    pub(crate) fn add_links(
        &mut self,
        context: &Arc<Context>,
        geometry: Geometry,
        traversal: Traversal,
    ) -> Result<(), GpuError> {
        let (accel, instances) = (geometry.accel(), geometry.instances());
        if accel.kind() != AccelKind::KdTree {
            return Ok(());
        }
        let (value, limit) = (self.arrays.triangles.len() as u64, u64::from(BRUTE_MAX_TRIANGLES));
        if traversal == Traversal::Brute && value > limit {
            return Err(GpuError::Limit { what: "triangles without a tree", value, limit });
        }
        let mut links = match (accel, &self.structures) {
            // The nodes may be the device's own.
            (Accel::LazyTree(tree), _) if traversal.needs_boxes() || traversal.needs_ropes() => {
                tree.links_of(self.arrays.kd_nodes.download()?, traversal)
            }
            (Accel::LazyTree(_), _) => TraversalLinks::default(),
            (Accel::TwoLevel(two), Some(structures)) => structures.links(&self.arrays.kd_nodes, two, traversal)?,
            _ => TraversalLinks::of(accel, geometry.triangles(), traversal),
        };
        let joined = match (accel, instances) {
            (Accel::TwoLevel(two), Some(instances)) if self.structures.is_none() => Some(Joined::new(two, instances)),
            _ => None,
        };
        if let (Some(joined), false) = (&joined, links.ropes.is_empty()) {
            joined.move_ropes(&mut links.ropes);
        }
        let mut next = self.clone();
        if traversal.needs_parents() && self.arrays.kd_parents.is_empty() {
            let tree = accel.as_kdtree(geometry.triangles());
            let write = |first: usize, chunk: &mut [u32]| match (&joined, tree) {
                (Some(joined), _) => joined.write_parents(first, chunk),
                (None, Some(tree)) => chunk.copy_from_slice(&tree.parents()[first..][..chunk.len()]),
                (None, None) => unreachable!("a grid has no links"),
            };
            let len = self.arrays.kd_nodes.len() / 2;
            next.arrays.kd_parents =
                Content::Written { len, write: &write }.upload(context, "kd_parents", self.access)?;
        }
        // A traversal reads boxes or ropes, not both.
        let rows: &[KdRope] = if links.ropes.is_empty() { cast_slice(&links.boxes) } else { &links.ropes };
        next.arrays.kd_links = Content::Elements(rows).upload(context, "kd_links", self.access)?;
        next.upload_constants(context)?;
        *self = next;
        Ok(())
    }

    /// Uploads the instances and the hierarchy over them, for geometries that are uploaded. Clones of these buffers
    /// keep their own. Descriptor sets over these buffers have to be made again.
    ///
    /// # Errors
    /// The buffer is beyond the device's limits, or memory runs out. Nothing has changed then.
    pub(crate) fn set_instances(&mut self, context: &Arc<Context>, geometry: Geometry) -> Result<(), GpuError> {
        let (Accel::TwoLevel(two), Some(instances)) = (geometry.accel(), geometry.instances()) else { return Ok(()) };
        let mut next = self.clone();
        let places = self.structures.as_ref().map_or_else(|| two.host_places(), |structures| structures.places());
        let rows = instance_rows(two, instances, &places, &mut next.uploaded);
        next.arrays.instance_rows = Content::Elements(&rows).upload(context, "instance_rows", self.access)?;
        next.upload_constants(context)?;
        *self = next;
        Ok(())
    }

    /// Builds the structures of geometries that are deformed in another pose of the world, and uploads their triangles
    /// and what textures need at their corners, into the arrays that are there. `before`: the buffers of the world
    /// before, the only other ones that may see the change. Returns whether it was possible; if not, everything has to
    /// be uploaded.
    ///
    /// # Errors
    /// Memory runs out, or a call fails. Some of the geometries may have changed then.
    pub(crate) fn set_pose(&self, context: &Arc<Context>, world: &World, before: &Self) -> Result<bool, GpuError> {
        let geometry = world.geometry();
        let (Accel::TwoLevel(two), Some(instances)) = (geometry.accel(), geometry.instances()) else {
            return Ok(false);
        };
        let Some(structures) = &self.structures else { return Ok(false) };
        // Links are those of certain trees.
        let others_read = Arc::strong_count(structures) > 2 || !self.arrays.kd_links.is_empty();
        let all = Geometries { two, instances, geometry, poses: world.poses() };
        let corners_begin = self.uploaded.corners_begin;
        let corners = (corners_begin != NO_WORDS).then(|| &world.scene().textures.corners);
        let arrays = Arrays {
            arrays: &self.arrays,
            rows_before: &before.arrays.instance_rows,
            geometries_begin: self.uploaded.geometries_begin as usize,
            corners,
            corners_begin: corners_begin as usize,
        };
        structures.update(context, &arrays, (&all, others_read))
    }

    /// Returns what makes others notice that these buffers are in use, as a clone does.
    pub(crate) fn shared(&self) -> Option<Arc<DeviceStructures>> {
        self.structures.clone()
    }

    /// Hides the triangles that other buffers of the same triangles hide.
    pub(crate) fn hide_as(&mut self, context: &Arc<Context>, other: &Self) -> Result<(), GpuError> {
        if other.filters {
            let hidden = other.arrays.triangle_materials.download()?;
            self.add_materials(context, &hidden)?;
            self.filters = true;
        }
        Ok(())
    }

    /// Uploads the emitters of a world that differs from the uploaded one in its instances.
    ///
    /// # Errors
    /// The buffer is beyond the device's limits, or memory runs out. Nothing has changed then.
    pub(super) fn set_emitters(&mut self, context: &Arc<Context>, world: &World) -> Result<(), GpuError> {
        match self.has_emitters {
            true => self.add_words(context, &TextureWords::new(&world.scene().textures, world.emitters())),
            false => Ok(()),
        }
    }

    /// Makes rays pass through the triangles with the indices `hidden`. This is for casts only, since the triangles'
    /// materials are overwritten. Descriptor sets and kernels over these buffers have to be made again.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out. Nothing has changed then.
    ///
    /// # Panics
    /// An index is not that of a triangle.
    pub(crate) fn hide(&mut self, context: &Arc<Context>, hidden: &[u32]) -> Result<(), GpuError> {
        let mut next = self.clone();
        next.add_materials(context, &hidden_words(self.n_triangles, hidden))?;
        *self = Self { filters: true, ..next };
        Ok(())
    }

    /// The way in which kernels read the arrays.
    pub fn access(&self) -> SceneAccess {
        self.access
    }

    /// The specialization constants of all kernels that read the arrays, in frames of paths or elsewhere.
    pub(super) fn constants(&self, of_paths: bool) -> Constants {
        let (mask_words, n_levels) = match self.structure {
            Structure::KdTree { mask_words } => (mask_words, 0),
            Structure::Grid { n_levels } => (1, n_levels),
        };
        // One loop more stands around all others, so that more iterations go by in which a lane only waits.
        let budget = match self.suspended_rays.iteration_budget() {
            0 => 0,
            budget if self.is_instanced => (budget / 8).max(4),
            budget => budget,
        };
        let constants = Constants::new()
            .set(constants::READING, self.access.constant())
            .set(constants::SKIPS_HIDDEN, self.filters)
            .set(constants::MASK_WORDS, mask_words)
            .set(constants::GRID_LEVELS, n_levels)
            .set(constants::INSTANCED, self.is_instanced)
            .set(constants::ITERATION_BUDGET, budget);
        self.surface_features.set(constants, of_paths)
    }

    /// Uploads the constants, with the arrays' addresses if kernels read by address. They go to a new buffer, since
    /// clones still read the previous one.
    fn upload_constants(&mut self, context: &Arc<Context>) -> Result<(), GpuError> {
        if self.access == SceneAccess::Address {
            self.arrays.write_addresses(&mut self.uploaded);
        }
        self.constants = Buffer::with(context, "accel", &[self.uploaded], BufferUse::Uniform)?;
        Ok(())
    }

    /// Returns the objects that [`bindings`] are bound to.
    pub(super) fn objects(&self) -> Vec<(u32, Binding<'_>)> {
        let own = [(BIND_ACCEL, Binding::Buffer(self.constants.any())), self.suspended_rays.object()];
        own.into_iter().chain(self.arrays.objects()).collect()
    }
}

/// Writes the triangles of the leaves' entries from entry `first` on. `entries`: the index of each entry's triangle.
pub(super) fn leaf_triangles(triangles: &[Triangle], entries: &[u32], first: usize, chunk: &mut [LeafTriangle]) {
    let numbers = &entries[first..][..chunk.len()];
    chunk.par_iter_mut().zip(numbers).for_each(|(entry, &triangle_ix)| *entry = leaf_triangle(triangles, triangle_ix));
}

/// Returns for each triangle `TRIANGLE_HIDDEN` if its index is in `hidden`, else 0.
pub(crate) fn hidden_words(n_triangles: usize, hidden: &[u32]) -> Vec<u32> {
    let mut words = vec![0; n_triangles];
    hidden.iter().for_each(|&triangle_ix| words[triangle_ix as usize] = TRIANGLE_HIDDEN);
    words
}

/// Returns the contents with structures that a device has built, in arrays for `usage`.
fn with_structures<'a>(arrays: StructureArrays, usage: BufferUse, contents: Contents<'a>) -> Contents<'a> {
    Contents {
        kd_nodes: Content::OnDevice(arrays.nodes, usage),
        kd_parents: Content::OnDevice(arrays.parents, usage),
        leaf_triangles: Content::OnDevice(arrays.leaf_triangles, usage),
        leaf_planes: Content::OnDevice(arrays.leaf_planes, usage),
        kd_slabs: Content::OnDevice(arrays.slabs, usage),
        grid_cells: Content::OnDevice(arrays.cells, usage),
        ..contents
    }
}

/// Returns the contents with triangles that are on the device already. Those that are read by address are uploaded once
/// more.
fn with_triangles<'a>(on_device: Buffer<Triangle>, usage: BufferUse, contents: Contents<'a>) -> Contents<'a> {
    match usage {
        BufferUse::Texels => Contents { triangles: Content::OnDevice(on_device, usage), ..contents },
        _ => contents,
    }
}

/// Returns the tree's slabs, or an empty slice for a device that predicates branches, since its kernels do not read
/// slabs.
fn slabs_for<'a>(context: &Context, tree: &'a KdTree) -> &'a [Slab] {
    if context.predicates_branches() { &[] } else { tree.slabs() }
}
