//! What grows with the scene, a part of every descriptor set: triangles and their tree.

use std::sync::Arc;

use bytemuck::Pod;
use rayon::prelude::*;

use super::Stalls;
use crate::{
    accel::kdtree::{Extras, KdTree, Traversal},
    gpu::{AnyBuffer, Binding, Buffer, BufferUse, Constants, Context, GpuError, texel_bytes},
    layout::{
        Addresses, BIND_ADDRESSES, BIND_FRAME, BIND_KD_BOXES, BIND_KD_NODES, BIND_KD_PARENTS, BIND_KD_ROPES,
        BIND_KD_SLABS, BIND_LEAF_PLANES, BIND_LEAF_TRIANGLES, BIND_STALLS, BIND_TEXELS, BIND_TRIANGLE_MATERIALS,
        BIND_TRIANGLES, BRUTE_MAX_TRIANGLES, Frame, KD_WORD_DEPTH, KdBox, KdNode, KdRope, LeafTriangle, Plane,
        READING_ADDRESS, READING_BOUND, READING_TEXELS, Slab, Triangle, constants,
    },
    world::Geometry,
};

/// The numbers of what is read in one of three ways, in the order of [`Tree::arrays`].
const ARRAYS: [u32; 9] = [
    BIND_TRIANGLES,
    BIND_TRIANGLE_MATERIALS,
    BIND_KD_NODES,
    BIND_KD_PARENTS,
    BIND_LEAF_TRIANGLES,
    BIND_LEAF_PLANES,
    BIND_KD_SLABS,
    BIND_KD_BOXES,
    BIND_KD_ROPES,
];

/// The bindings' numbers.
pub(super) fn bindings() -> impl Iterator<Item = u32> {
    [BIND_FRAME, BIND_ADDRESSES].into_iter().chain([BIND_STALLS]).chain(ARRAYS).chain(texel_bindings())
}

/// Those of texels.
pub(super) fn texel_bindings() -> impl Iterator<Item = u32> {
    ARRAYS.into_iter().map(|number| BIND_TEXELS + number)
}

/// How kernels read triangles and tree (glsl/shared/scene.glsl).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneAccess {
    Bound,
    /// Software drivers, if no array has more texels than the device allows for.
    Texels,
    /// Where an array is larger than what the device binds.
    Address,
}

impl SceneAccess {
    fn of(context: &Context, arrays: &[Extent]) -> Self {
        let limits = context.limits();
        if context.runs_both_sides() && arrays.iter().all(|array| array.n_texels <= u64::from(limits.n_texels)) {
            Self::Texels
        } else if arrays.iter().all(|array| array.bytes <= limits.storage_range) {
            Self::Bound
        } else {
            Self::Address
        }
    }

    fn constant(self) -> u32 {
        match self {
            Self::Bound => READING_BOUND,
            Self::Texels => READING_TEXELS,
            Self::Address => READING_ADDRESS,
        }
    }
}

/// Triangles, their kd-tree, and the constants that hold the root's cell. A clone is a second handle to the same
/// buffers.
#[derive(Clone)]
pub struct AccelBuffers {
    /// One.
    pub frame: Buffer<Frame>,
    /// One: of the buffers below.
    addresses: Buffer<Addresses>,
    pub triangles: Buffer<Triangle>,
    /// One a triangle, after `add_materials`.
    pub triangle_materials: Buffer<u32>,
    pub kd_nodes: Buffer<KdNode>,
    /// One a pair of nodes.
    pub kd_parents: Buffer<u32>,
    /// One a leaf's entry.
    pub leaf_triangles: Buffer<LeafTriangle>,
    /// One a leaf's entry, or none.
    pub leaf_planes: Buffer<Plane>,
    /// One a node, or none.
    pub kd_slabs: Buffer<Slab>,
    /// One a node, after `add_extras`.
    pub kd_boxes: Buffer<KdBox>,
    /// Six a node, after `add_extras`.
    pub kd_ropes: Buffer<KdRope>,
    /// Rays that have stopped on their way through the tree.
    pub stalls: Stalls,
    access: SceneAccess,
    /// Of the traversal's mask.
    mask_words: u32,
}

impl AccelBuffers {
    /// Uploads triangles, tree and constants.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(context: &Arc<Context>, geometry: Geometry, constants: &Frame) -> Result<Self, GpuError> {
        let (triangles, tree) = (geometry.triangles(), geometry.tree());
        let slabs = slabs_for(context, tree);
        let access = SceneAccess::of(context, &extents(triangles, tree, slabs));
        let usage = buffer_use(access);
        let made = Self {
            frame: Buffer::with(context, "frame", &[*constants], BufferUse::Uniform)?,
            addresses: Buffer::new(context, "addresses", 1, BufferUse::Uniform)?,
            triangles: Buffer::with(context, "triangles", triangles, usage)?,
            triangle_materials: Buffer::new(context, "triangle_materials", 0, usage)?,
            kd_nodes: Buffer::with(context, "kd_nodes", tree.nodes(), usage)?,
            kd_parents: Buffer::with(context, "kd_parents", tree.parents(), usage)?,
            leaf_triangles: leaf_triangles(context, triangles, tree, usage)?,
            leaf_planes: Buffer::with(context, "leaf_planes", tree.leaf_planes(), usage)?,
            kd_slabs: Buffer::with(context, "kd_slabs", slabs, usage)?,
            kd_boxes: Buffer::new(context, "kd_boxes", 0, usage)?,
            kd_ropes: Buffer::new(context, "kd_ropes", 0, usage)?,
            stalls: Stalls::new(context)?,
            access,
            mask_words: if tree.depth() <= KD_WORD_DEPTH { 1 } else { 2 },
        };
        made.addresses.upload(&[made.addresses()])?;
        Ok(made)
    }

    /// Uploads the triangles' materials, which a cast has no use for. Descriptor sets are to be made anew.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub(super) fn add_materials(&mut self, context: &Arc<Context>, triangle_materials: &[u32]) -> Result<(), GpuError> {
        self.triangle_materials =
            Buffer::with(context, "triangle_materials", triangle_materials, buffer_use(self.access))?;
        self.addresses.upload(&[self.addresses()])
    }

    /// Uploads what the traversal reads beside the tree, which is the uploaded one. Clones of this tree keep what they had. Descriptor sets are to
    /// be made anew.
    ///
    /// # Errors
    /// The tree is as before then. Too many triangles for brute force;
    /// beyond the device's limits, out of memory.
    pub(crate) fn add_extras(
        &mut self,
        context: &Arc<Context>,
        tree: &KdTree,
        traversal: Traversal,
    ) -> Result<(), GpuError> {
        let (value, limit) = (self.triangles.len() as u64, u64::from(BRUTE_MAX_TRIANGLES));
        if traversal == Traversal::Brute && value > limit {
            return Err(GpuError::Limit { what: "triangles without a tree", value, limit });
        }
        let extras = Extras::new(tree, traversal);
        let usage = buffer_use(self.access);
        let kd_boxes = Buffer::with(context, "kd_boxes", &extras.boxes, usage)?;
        let kd_ropes = Buffer::with(context, "kd_ropes", &extras.ropes, usage)?;
        let (boxes_at, ropes_at) = (self.address_of(&kd_boxes), self.address_of(&kd_ropes));
        let addresses = Addresses { kd_boxes: boxes_at, kd_ropes: ropes_at, ..self.addresses() };
        // A buffer of its own, since clones of this tree still read the one before.
        self.addresses = Buffer::with(context, "addresses", &[addresses], BufferUse::Uniform)?;
        (self.kd_boxes, self.kd_ropes) = (kd_boxes, kd_ropes);
        Ok(())
    }

    /// How kernels read it.
    pub fn access(&self) -> SceneAccess {
        self.access
    }

    /// Specialization constants of all kernels that read it.
    pub(super) fn constants(&self) -> Constants {
        Constants::new()
            .set(constants::READING, self.access.constant())
            .set(constants::MASK_WORDS, self.mask_words)
            .set(constants::TURN_BUDGET, self.stalls.turn_budget())
    }

    fn addresses(&self) -> Addresses {
        Addresses {
            triangles: self.address_of(&self.triangles),
            triangle_materials: self.address_of(&self.triangle_materials),
            kd_nodes: self.address_of(&self.kd_nodes),
            kd_parents: self.address_of(&self.kd_parents),
            leaf_triangles: self.address_of(&self.leaf_triangles),
            leaf_planes: self.address_of(&self.leaf_planes),
            kd_slabs: self.address_of(&self.kd_slabs),
            kd_boxes: self.address_of(&self.kd_boxes),
            kd_ropes: self.address_of(&self.kd_ropes),
        }
    }

    /// 0 where it is not read by it.
    fn address_of<T: Pod>(&self, buffer: &Buffer<T>) -> [u32; 2] {
        if self.access == SceneAccess::Address { buffer.address() } else { [0; 2] }
    }

    /// What is read in one of three ways.
    fn arrays(&self) -> [&AnyBuffer; ARRAYS.len()] {
        [
            self.triangles.any(),
            self.triangle_materials.any(),
            self.kd_nodes.any(),
            self.kd_parents.any(),
            self.leaf_triangles.any(),
            self.leaf_planes.any(),
            self.kd_slabs.any(),
            self.kd_boxes.any(),
            self.kd_ropes.any(),
        ]
    }

    /// For [`bindings`].
    pub(super) fn objects(&self) -> Vec<(u32, Binding<'_>)> {
        let own =
            [(BIND_FRAME, Binding::Buffer(self.frame.any())), (BIND_ADDRESSES, Binding::Buffer(self.addresses.any()))];
        let arrays = ARRAYS.into_iter().zip(self.arrays());
        let bound = arrays.clone().map(|(number, buffer)| (number, Binding::Buffer(buffer)));
        let texels = arrays.map(|(number, buffer)| (BIND_TEXELS + number, Binding::Texels(buffer)));
        own.into_iter().chain([self.stalls.object()]).chain(bound).chain(texels).collect()
    }
}

/// The triangles in the leaves' order.
fn leaf_triangles(
    context: &Arc<Context>,
    triangles: &[Triangle],
    tree: &KdTree,
    usage: BufferUse,
) -> Result<Buffer<LeafTriangle>, GpuError> {
    let entry_of = |triangle_ix: u32| {
        let Triangle { v0, v1, v2, .. } = triangles[triangle_ix as usize];
        LeafTriangle { v0, triangle_ix, v1, v2, ..LeafTriangle::default() }
    };
    let entries = tree.leaf_triangles();
    Buffer::written_by(context, "leaf_triangles", entries.len(), usage, |first, part| {
        let numbers = &entries[first..][..part.len()];
        part.par_iter_mut().zip(numbers).for_each(|(entry, &triangle_ix)| *entry = entry_of(triangle_ix));
    })
}

/// Of the arrays that are read so.
fn buffer_use(access: SceneAccess) -> BufferUse {
    if access == SceneAccess::Address { BufferUse::Address } else { BufferUse::Texels }
}

/// What spares rays nodes, where the kernels look at it: not where they run both sides of every branch.
fn slabs_for<'a>(context: &Context, tree: &'a KdTree) -> &'a [Slab] {
    if context.runs_both_sides() { &[] } else { tree.slabs() }
}

/// How much an array takes.
struct Extent {
    bytes: u64,
    n_texels: u64,
}

impl Extent {
    fn of<T>(len: usize) -> Self {
        let bytes = (len * size_of::<T>()) as u64;
        Self { bytes, n_texels: bytes / texel_bytes::<T>() }
    }
}

/// Of all arrays, with those that any traversal asks for: in the way that one can be read, all can.
fn extents(triangles: &[Triangle], tree: &KdTree, slabs: &[Slab]) -> [Extent; 8] {
    let n_nodes = tree.nodes().len();
    [
        Extent::of::<Triangle>(triangles.len()),
        Extent::of::<KdNode>(n_nodes),
        Extent::of::<u32>(tree.parents().len()),
        Extent::of::<LeafTriangle>(tree.leaf_triangles().len()),
        Extent::of::<Plane>(tree.leaf_planes().len()),
        Extent::of::<Slab>(slabs.len()),
        Extent::of::<KdBox>(n_nodes),
        Extent::of::<KdRope>(6 * n_nodes),
    ]
}
