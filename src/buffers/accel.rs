//! The scene's triangles with their acceleration structure on a device: a part of every descriptor set.

use std::sync::Arc;

use rayon::prelude::*;

use super::{
    Stalls,
    scene_arrays::{Content, Contents, SceneAccess, SceneArrays},
};
use crate::{
    accel::{
        Accel,
        grid::{Grid, LazyGrid},
        kdtree::{KdTree, Traversal, TraversalLinks},
    },
    gpu::{Binding, Buffer, BufferUse, Constants, Context, GpuError, Timer},
    layout::{
        AccelConstants, BIND_ACCEL, BIND_STALLS, BRUTE_MAX_TRIANGLES, KD_WORD_DEPTH, LeafTriangle, Slab,
        TRIANGLE_HIDDEN, Triangle, constants,
    },
    passes::grid::GridBuilder,
    world::Geometry,
};

/// The bindings' numbers.
pub(super) fn bindings() -> impl Iterator<Item = u32> {
    [BIND_ACCEL, BIND_STALLS].into_iter().chain(SceneArrays::bindings())
}

/// What kernels are specialized for.
#[derive(Clone, Copy)]
enum Structure {
    /// `mask_words`: the number of words of the traversal's bit mask.
    KdTree { mask_words: u32 },
    /// `n_levels`: the number of levels of cells, 1 or 2.
    Grid { n_levels: u32 },
}

/// Triangles, their acceleration structure, and what kernels know of both. A clone is a second handle to the same buffers.
#[derive(Clone)]
pub struct AccelBuffers {
    /// One.
    constants: Buffer<AccelConstants>,
    pub arrays: SceneArrays,
    /// Rays that have stopped on their way through the tree.
    pub stalls: Stalls,
    access: SceneAccess,
    structure: Structure,
    /// Whether rays pass through some of the triangles.
    filters: bool,
    /// What `constants` holds.
    uploaded: AccelConstants,
}

impl AccelBuffers {
    /// Uploads triangles and their structure.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(context: &Arc<Context>, geometry: Geometry) -> Result<Self, GpuError> {
        let triangles = geometry.triangles();
        match geometry.accel() {
            Accel::KdTree(tree) => Self::of_tree(context, triangles, tree),
            Accel::Grid(grid) if GridBuilder::has_room(context, triangles.len()) => {
                Self::of_device_grid(context, triangles, grid)
            }
            Accel::Grid(grid) => Self::of_grid(context, triangles, grid.get(triangles)),
        }
    }

    fn of_tree(context: &Arc<Context>, triangles: &[Triangle], tree: &KdTree) -> Result<Self, GpuError> {
        let n_nodes = tree.nodes().len();
        let entries = tree.leaf_triangles();
        let write_entries = |first: usize, part: &mut [LeafTriangle]| leaf_triangles(triangles, entries, first, part);
        let contents = Contents {
            kd_nodes: Content::Elements(tree.nodes()),
            kd_parents: Content::Elements(tree.parents()),
            leaf_triangles: Content::Written { len: entries.len(), write: &write_entries },
            leaf_planes: Content::Elements(tree.leaf_planes()),
            kd_slabs: Content::Elements(slabs_for(context, tree)),
            kd_boxes: Content::Reserved(n_nodes),
            kd_ropes: Content::Reserved(6 * n_nodes),
            ..Contents::of_triangles(triangles)
        };
        let mask_words = if tree.depth() <= KD_WORD_DEPTH { 1 } else { 2 };
        Self::with(context, contents, &tree.constants(), Structure::KdTree { mask_words })
    }

    /// Uploads triangles, of which the device builds the grid.
    fn of_device_grid(context: &Arc<Context>, triangles: &[Triangle], grid: &LazyGrid) -> Result<Self, GpuError> {
        let on_device = Buffer::with(context, "triangles", triangles, BufferUse::Texels)?;
        let builder = GridBuilder::new(context, &on_device, grid.options())?;
        let timer = Timer::new(context, builder.n_stages())?;
        let built = builder.build(Some(&timer), BufferUse::Texels)?;
        drop(builder); // its memory is larger than the grid's
        grid.note(built.report(triangles.len()));
        let (constants, structure) = (built.constants(), Structure::Grid { n_levels: built.n_levels });
        let contents = Contents {
            triangles: Content::OnDevice(on_device),
            grid_cells: Content::OnDevice(built.cells),
            leaf_triangles: Content::OnDevice(built.leaf_triangles),
            leaf_planes: Content::OnDevice(built.leaf_planes),
            ..Contents::of_triangles(triangles)
        };
        Self::with(context, contents, &constants, structure)
    }

    /// Uploads triangles and the host's grid, where the triangles are more than the device binds.
    fn of_grid(context: &Arc<Context>, triangles: &[Triangle], grid: &Grid) -> Result<Self, GpuError> {
        let entries = grid.leaf_triangles();
        let write_entries = |first: usize, part: &mut [LeafTriangle]| leaf_triangles(triangles, entries, first, part);
        let contents = Contents {
            grid_cells: Content::Elements(grid.cells()),
            leaf_triangles: Content::Written { len: entries.len(), write: &write_entries },
            leaf_planes: Content::Elements(grid.leaf_planes()),
            ..Contents::of_triangles(triangles)
        };
        Self::with(context, contents, &grid.constants(), Structure::Grid { n_levels: grid.n_levels() })
    }

    /// Uploads the arrays. `constants`: all but the number of triangles and the arrays' addresses.
    fn with(
        context: &Arc<Context>,
        contents: Contents,
        constants: &AccelConstants,
        structure: Structure,
    ) -> Result<Self, GpuError> {
        let access = SceneAccess::of(context, &contents);
        let arrays = contents.upload(context, access)?;
        let uploaded = AccelConstants { n_triangles: arrays.triangles.len() as u32, ..*constants };
        let mut made = Self {
            constants: Buffer::new(context, "accel", 1, BufferUse::Uniform)?,
            arrays,
            stalls: Stalls::new(context)?,
            access,
            filters: false,
            structure,
            uploaded,
        };
        made.upload_constants(context)?;
        Ok(made)
    }

    /// Uploads the triangles' materials, for which a cast has no use. Descriptor sets over these buffers have to be made
    /// again.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub(super) fn add_materials(&mut self, context: &Arc<Context>, triangle_materials: &[u32]) -> Result<(), GpuError> {
        let materials = Content::Elements(triangle_materials);
        self.arrays.triangle_materials = materials.upload(context, "triangle_materials", self.access)?;
        self.upload_constants(context)
    }

    /// Uploads what the traversal reads beside the structure, which is the uploaded one: nothing for a grid. Clones of these buffers keep what
    /// they had. Descriptor sets over these buffers have to be made again.
    ///
    /// # Errors
    /// Nothing has changed then. Too many triangles for brute force; beyond the device's limits, out of memory.
    pub(crate) fn add_links(
        &mut self,
        context: &Arc<Context>,
        accel: &Accel,
        traversal: Traversal,
    ) -> Result<(), GpuError> {
        let Accel::KdTree(tree) = accel else { return Ok(()) };
        let (value, limit) = (self.arrays.triangles.len() as u64, u64::from(BRUTE_MAX_TRIANGLES));
        if traversal == Traversal::Brute && value > limit {
            return Err(GpuError::Limit { what: "triangles without a tree", value, limit });
        }
        let links = TraversalLinks::new(tree, traversal);
        let mut next = self.clone();
        next.arrays.kd_boxes = Content::Elements(&links.boxes).upload(context, "kd_boxes", self.access)?;
        next.arrays.kd_ropes = Content::Elements(&links.ropes).upload(context, "kd_ropes", self.access)?;
        next.upload_constants(context)?;
        *self = next;
        Ok(())
    }

    /// Makes rays pass through the triangles of these indices. Frames over these buffers lose their materials by it: it is
    /// for casts. Descriptor sets and kernels over these buffers have to be made again.
    ///
    /// # Errors
    /// Nothing has changed then. Beyond the device's limits, out of memory.
    ///
    /// # Panics
    /// There is no triangle of an index.
    pub(crate) fn hide(&mut self, context: &Arc<Context>, hidden: &[u32]) -> Result<(), GpuError> {
        let mut next = self.clone();
        next.add_materials(context, &hidden_words(self.arrays.triangles.len(), hidden))?;
        *self = Self { filters: true, ..next };
        Ok(())
    }

    /// How kernels read the arrays.
    pub fn access(&self) -> SceneAccess {
        self.access
    }

    /// Specialization constants of all kernels that read the arrays.
    pub(super) fn constants(&self) -> Constants {
        let (mask_words, n_levels) = match self.structure {
            Structure::KdTree { mask_words } => (mask_words, 0),
            Structure::Grid { n_levels } => (1, n_levels),
        };
        Constants::new()
            .set(constants::READING, self.access.constant())
            .set(constants::FILTERS, self.filters)
            .set(constants::MASK_WORDS, mask_words)
            .set(constants::GRID_LEVELS, n_levels)
            .set(constants::TURN_BUDGET, self.stalls.turn_budget())
    }

    /// Makes the constants' buffer hold the arrays' addresses. It is another buffer then, since clones still read the one
    /// before.
    fn upload_constants(&mut self, context: &Arc<Context>) -> Result<(), GpuError> {
        if self.access == SceneAccess::Address {
            self.arrays.write_addresses(&mut self.uploaded);
        }
        self.constants = Buffer::with(context, "accel", &[self.uploaded], BufferUse::Uniform)?;
        Ok(())
    }

    /// For [`bindings`].
    pub(super) fn objects(&self) -> Vec<(u32, Binding<'_>)> {
        let own = [(BIND_ACCEL, Binding::Buffer(self.constants.any())), self.stalls.object()];
        own.into_iter().chain(self.arrays.objects()).collect()
    }
}

/// Writes the triangles of the leaves' entries, from entry `first` on.
fn leaf_triangles(triangles: &[Triangle], entries: &[u32], first: usize, part: &mut [LeafTriangle]) {
    let numbers = &entries[first..][..part.len()];
    part.par_iter_mut().zip(numbers).for_each(|(entry, &triangle_ix)| {
        let Triangle { v0, v1, v2, .. } = triangles[triangle_ix as usize];
        *entry = LeafTriangle { v0, triangle_ix, v1, v2, ..LeafTriangle::default() };
    });
}

/// For each of the triangles, `TRIANGLE_HIDDEN` if its index is one of the hidden ones, else 0.
pub(crate) fn hidden_words(n_triangles: usize, hidden: &[u32]) -> Vec<u32> {
    let mut words = vec![0; n_triangles];
    hidden.iter().for_each(|&triangle_ix| words[triangle_ix as usize] = TRIANGLE_HIDDEN);
    words
}

/// The slabs, if the device's kernels look at them: those that run both sides of every branch do not.
fn slabs_for<'a>(context: &Context, tree: &'a KdTree) -> &'a [Slab] {
    if context.predicates_branches() { &[] } else { tree.slabs() }
}
