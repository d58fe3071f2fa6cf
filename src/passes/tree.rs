//! What grows with the scene, a part of every descriptor set: triangles and their tree.

use std::sync::Arc;

use bytemuck::Pod;

use crate::{
    frame::Traversal,
    gpu::{Binding, Buffer, BufferUse, Context, GpuError},
    kdtree::{Extras, KdTree},
    layout::{
        Addresses, BIND_ADDRESSES, BIND_FRAME, BIND_KD_BOXES, BIND_KD_NODES, BIND_KD_PARENTS, BIND_KD_ROPES,
        BIND_KD_SLABS, BIND_LEAF_PLANES, BIND_LEAF_TRIANGLES, BIND_TRIANGLE_MATERIALS, BIND_TRIANGLES,
        BRUTE_MAX_TRIANGLES, CONSTANT_BY_ADDRESS, CONSTANT_MASK_WORDS, Frame, KD_WORD_DEPTH, KdBox, KdNode, Plane,
        Slab, Triangle,
    },
};

/// The bindings' numbers.
pub(super) const BINDINGS: [u32; 11] = [
    BIND_FRAME,
    BIND_ADDRESSES,
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

/// Triangles, their kd-tree, and the constants that hold the root's cell.
///
/// Where one of the buffers of triangles and tree is larger than what the device binds, kernels read all of them by
/// address (glsl/shared/scene.glsl).
pub struct Tree {
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
    pub leaf_triangles: Buffer<u32>,
    /// One an entry of `leaf_triangles`, or none.
    pub leaf_planes: Buffer<Plane>,
    /// One a node, or none.
    pub kd_slabs: Buffer<Slab>,
    /// One a node, after `add_extras`.
    pub kd_boxes: Buffer<KdBox>,
    /// Six a node, after `add_extras`.
    pub kd_ropes: Buffer<u32>,
    usage: BufferUse,
    /// Of the traversal's mask.
    mask_words: u32,
}

impl Tree {
    /// Uploads triangles, tree and constants.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn new(
        context: &Arc<Context>,
        triangles: &[Triangle],
        tree: &KdTree,
        constants: &Frame,
    ) -> Result<Self, GpuError> {
        let sparing = Sparing::of(context, tree);
        let is_bound = most_bytes(triangles, tree, &sparing) as u64 <= context.limits().storage_range;
        let usage = if is_bound { BufferUse::Storage } else { BufferUse::Address };
        let made = Self {
            frame: Buffer::with(context, "frame", &[*constants], BufferUse::Uniform)?,
            addresses: Buffer::new(context, "addresses", 1, BufferUse::Uniform)?,
            triangles: Buffer::with(context, "triangles", triangles, usage)?,
            triangle_materials: Buffer::new(context, "triangle_materials", 0, usage)?,
            kd_nodes: Buffer::with(context, "kd_nodes", &tree.nodes, usage)?,
            kd_parents: Buffer::with(context, "kd_parents", &tree.parents, usage)?,
            leaf_triangles: Buffer::with(context, "leaf_triangles", &tree.leaf_triangles, usage)?,
            leaf_planes: Buffer::with(context, "leaf_planes", sparing.leaf_planes, usage)?,
            kd_slabs: Buffer::with(context, "kd_slabs", sparing.slabs, usage)?,
            kd_boxes: Buffer::new(context, "kd_boxes", 0, usage)?,
            kd_ropes: Buffer::new(context, "kd_ropes", 0, usage)?,
            usage,
            mask_words: if tree.depth <= KD_WORD_DEPTH { 1 } else { 2 },
        };
        made.addresses.upload(&[made.addresses()])?;
        Ok(made)
    }

    /// Uploads the triangles' materials, which a cast has no use for. Descriptor sets are to be made anew.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn add_materials(&mut self, context: &Arc<Context>, triangle_materials: &[u32]) -> Result<(), GpuError> {
        self.triangle_materials = Buffer::with(context, "triangle_materials", triangle_materials, self.usage)?;
        self.addresses.upload(&[self.addresses()])
    }

    /// Uploads what the traversal reads beside the tree. Descriptor sets are to be made anew.
    ///
    /// # Errors
    /// Too many triangles for brute force; beyond the device's limits, out of memory.
    pub fn add_extras(&mut self, context: &Arc<Context>, tree: &KdTree, traversal: Traversal) -> Result<(), GpuError> {
        let (value, limit) = (self.triangles.len() as u64, u64::from(BRUTE_MAX_TRIANGLES));
        if traversal == Traversal::Brute && value > limit {
            return Err(GpuError::Limit { what: "triangles without a tree", value, limit });
        }
        let extras = Extras::new(tree, traversal);
        let kd_boxes = Buffer::with(context, "kd_boxes", &extras.boxes, self.usage)?;
        let kd_ropes = Buffer::with(context, "kd_ropes", &extras.ropes, self.usage)?;
        let (boxes_at, ropes_at) = (self.address_of(&kd_boxes), self.address_of(&kd_ropes));
        self.addresses.upload(&[Addresses { kd_boxes: boxes_at, kd_ropes: ropes_at, ..self.addresses() }])?;
        (self.kd_boxes, self.kd_ropes) = (kd_boxes, kd_ropes);
        Ok(())
    }

    /// Whether kernels read triangles and tree by address.
    pub fn is_by_address(&self) -> bool {
        self.usage == BufferUse::Address
    }

    /// Specialization constants of all kernels that read it.
    pub(super) fn constants(&self) -> [(u32, u32); 2] {
        [(CONSTANT_BY_ADDRESS, self.is_by_address().into()), (CONSTANT_MASK_WORDS, self.mask_words)]
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

    /// 0 where it is bound.
    fn address_of<T: Pod>(&self, buffer: &Buffer<T>) -> [u32; 2] {
        if self.is_by_address() { buffer.address() } else { [0; 2] }
    }

    /// For [`BINDINGS`].
    pub(super) fn objects(&self) -> [(u32, Binding<'_>); BINDINGS.len()] {
        let buffers = [
            self.frame.any(),
            self.addresses.any(),
            self.triangles.any(),
            self.triangle_materials.any(),
            self.kd_nodes.any(),
            self.kd_parents.any(),
            self.leaf_triangles.any(),
            self.leaf_planes.any(),
            self.kd_slabs.any(),
            self.kd_boxes.any(),
            self.kd_ropes.any(),
        ];
        std::array::from_fn(|i| (BINDINGS[i], Binding::Buffer(buffers[i])))
    }
}

/// What spares rays nodes and tests, where the kernels look at it: not where they run both sides of every branch.
struct Sparing<'a> {
    leaf_planes: &'a [Plane],
    slabs: &'a [Slab],
}

impl<'a> Sparing<'a> {
    fn of(context: &Context, tree: &'a KdTree) -> Self {
        if context.runs_both_sides() {
            return Self { leaf_planes: &[], slabs: &[] };
        }
        Self { leaf_planes: &tree.leaf_planes, slabs: &tree.slabs }
    }
}

/// Of the largest buffer, bytes, with those that any traversal asks for: what one can be bound by, all can.
fn most_bytes(triangles: &[Triangle], tree: &KdTree, sparing: &Sparing) -> usize {
    const ROPES_BYTES: usize = 6 * size_of::<u32>();
    let n_nodes = tree.nodes.len();
    let sizes = [
        size_of_val(triangles),
        size_of_val(&*tree.nodes),
        size_of_val(&*tree.parents),
        size_of_val(&*tree.leaf_triangles),
        size_of_val(sparing.leaf_planes),
        size_of_val(sparing.slabs),
        n_nodes * size_of::<KdBox>(),
        n_nodes * ROPES_BYTES,
    ];
    sizes.into_iter().max().unwrap_or(0)
}
