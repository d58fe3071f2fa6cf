//! Builds structures of geometries again, one after the other: of triangles that the host has, or that the device makes
//! of a mesh in a pose.

use std::{collections::HashMap, sync::Arc};

use super::{
    deform::DeformTarget,
    geometries::{Arrays, Geometries},
};
use crate::{
    accel::{
        DeviceBuild,
        bottom_level::LazyStructure,
        grid::Lattice,
        kdtree::{BuildOptions, LazyTree},
        two_level::StoredRange,
    },
    gpu::{Access, Buffer, BufferUse, Context, GpuError, Timer},
    layout::{NO_WORDS, StructurePlace, Triangle},
    passes::{
        deform::{Deform, DeformedMesh},
        grid::{BuiltGrid, GridBuilder},
        kdtree::{BuiltTree, KdTreeBuilder, KdTreeBuilderOptions},
        structures::{StructureArrays, StructureKind, Target, submit},
    },
    scene::deformation::{Deformation, PosedMesh},
};

/// Builds structures of geometries, one after the other.
pub(super) struct StructureBuilder {
    context: Arc<Context>,
    /// The triangles of the structure that is built are at the beginning.
    triangles: Buffer<Triangle>,
    kernels: Kernels,
    timer: Timer,
    /// What belongs to the corners of triangles, on its way to the arrays.
    pub corners: Buffer<u32>,
    /// The kernels that deform meshes. They are made for the first mesh.
    deform: Option<Deform>,
    /// The meshes that have been deformed, by the indices of their geometries.
    deformed: HashMap<usize, Deformed>,
}

/// What builds structures of one kind.
enum Kernels {
    KdTree(Box<KdTreeBuilder>),
    Grid(Box<GridBuilder>),
}

/// A finished build, until the next one.
pub(super) enum Built {
    KdTree(BuiltTree),
    Grid(BuiltGrid),
}

impl Built {
    /// The numbers of nodes or cells, and of entries.
    pub fn sizes(&self) -> (usize, usize) {
        match self {
            Self::KdTree(tree) => tree.sizes(),
            Self::Grid(grid) => grid.sizes(),
        }
    }

    /// The lattice of a grid.
    pub fn lattice(&self) -> Option<Lattice> {
        if let Self::Grid(grid) = self { Some(grid.lattice) } else { None }
    }

    fn report(&self, n_triangles: usize) -> DeviceBuild {
        match self {
            Self::KdTree(tree) => tree.report(n_triangles),
            Self::Grid(grid) => grid.report(n_triangles),
        }
    }
}

/// A mesh that the device deforms, and what it has been made of.
struct Deformed {
    deformation: Arc<Deformation>,
    faces: Arc<[[u32; 3]]>,
    mesh: DeformedMesh,
}

impl Deformed {
    fn is_of(&self, other: &PosedMesh) -> bool {
        Arc::ptr_eq(&self.deformation, other.deformation()) && Arc::ptr_eq(&self.faces, other.faces())
    }
}

impl StructureBuilder {
    /// `like`: a structure of a world, whose options are those of all.
    pub fn new(
        context: &Arc<Context>,
        (n_triangles, n_corner_words): (usize, usize),
        like: LazyStructure,
    ) -> Result<Self, GpuError> {
        let triangles = Buffer::new(context, "build_triangles", n_triangles, BufferUse::Storage)?;
        let (kernels, n_stages) = match like {
            LazyStructure::KdTree(tree) => {
                let kernels = KdTreeBuilder::new(context, &triangles, &builder_options(context, tree))?;
                let n_stages = kernels.n_stages();
                (Kernels::KdTree(Box::new(kernels)), n_stages)
            }
            LazyStructure::Grid(grid) => {
                let kernels = GridBuilder::new(context, &triangles, grid.options())?;
                let n_stages = kernels.n_stages();
                (Kernels::Grid(Box::new(kernels)), n_stages)
            }
        };
        let timer = Timer::new(context, n_stages)?;
        let corners = Buffer::new(context, "build_corners", n_corner_words, BufferUse::Storage)?;
        let (context, deform, deformed) = (context.clone(), None, HashMap::new());
        Ok(Self { context, triangles, kernels, timer, corners, deform, deformed })
    }

    /// The buffer of the triangles.
    pub fn triangles(&self) -> &Buffer<Triangle> {
        &self.triangles
    }

    /// Copies the triangles of a geometry, which are stored on the device, into the builder.
    pub fn take_stored(&self, stored: &Buffer<Triangle>, range: StoredRange) -> Result<(), GpuError> {
        let [first, len] = [range.first_row, range.n_triangles].map(|n| u64::from(n) * size_of::<Triangle>() as u64);
        submit(&self.context, "take_triangles", |commands| {
            commands.copy_buffer_range((stored.any(), first), (self.triangles.any(), 0), len);
        })
    }

    /// Puts the triangles of a geometry into the builder, and the tangents and colours at their corners. Returns the
    /// number of words of corners to copy to the arrays; 0 if the corners there are right already.
    pub fn take(&mut self, arrays: &Arrays, (all, ix): (&Geometries, usize)) -> Result<usize, GpuError> {
        let first_row = all.instances.ranges[ix].first_row as usize;
        if let Some(posed) = all.poses.get(ix) {
            match self.deform(arrays, (ix, posed), first_row) {
                Err(error) if error.is_lack_of_room() => tracing::info!("the host deforms geometry {ix}: {error}"),
                done => return done,
            }
        }
        let triangles = all.triangles(ix);
        self.triangles.upload_at(0, &triangles)?;
        let corners = arrays.corners_of(first_row, triangles.len());
        self.corners.upload_at(0, corners)?;
        Ok(corners.len())
    }

    /// Does what [`StructureBuilder::take`] does for a mesh in a pose. Only the pose is uploaded.
    fn deform(
        &mut self,
        arrays: &Arrays,
        (ix, posed): (usize, &Arc<PosedMesh>),
        first_row: usize,
    ) -> Result<usize, GpuError> {
        let deform = match self.deform.take() {
            Some(made) => made,
            None => Deform::new(&self.context)?,
        };
        let deform = self.deform.insert(deform);
        if !self.deformed.get(&ix).is_some_and(|it| it.is_of(posed)) {
            self.deformed.remove(&ix); // its memory serves the next one
            let corners = (arrays.n_corner_words() > 0).then_some((self.corners.any(), 0));
            let target = DeformTarget { triangles: self.triangles.any(), first_row: 0, corners };
            let mesh = deform.mesh((posed.deformation(), posed.faces()), target)?;
            let (deformation, faces) = (posed.deformation().clone(), posed.faces().clone());
            self.deformed.insert(ix, Deformed { deformation, faces, mesh });
        }
        let mesh = &self.deformed[&ix].mesh;
        let has_corners = mesh.buffers.mesh.first_corner_word != NO_WORDS;
        let n_words = if has_corners { posed.faces().len() * arrays.n_corner_words() } else { 0 };
        let bytes = |n_words: usize| (n_words * size_of::<u32>()) as u64;
        submit(&self.context, "deform", |commands| {
            if n_words > 0 {
                // The kernels leave the colours as they are.
                let from = (arrays.arrays.texture_words.any(), bytes(arrays.first_word(first_row)));
                commands.copy_buffer_range(from, (self.corners.any(), 0), bytes(n_words));
                commands.barrier(Access::TransferWrite, Access::ComputeWrite); // corners
            }
            deform.record(commands, mesh, posed.pose());
        })?;
        Ok(n_words)
    }

    /// Builds the structure of the triangles that are in the builder, and adds the report to `reports`.
    pub fn build(&self, structure: LazyStructure, reports: &mut Vec<DeviceBuild>) -> Result<Built, GpuError> {
        let (n_triangles, timer) = (structure.n_triangles(), Some(&self.timer));
        let built = match &self.kernels {
            Kernels::KdTree(kernels) => Built::KdTree(kernels.build_first(n_triangles, timer)?),
            Kernels::Grid(kernels) => Built::Grid(kernels.build_first(n_triangles, timer)?),
        };
        let report = built.report(n_triangles);
        structure.note(report.clone());
        reports.push(report);
        Ok(built)
    }

    /// Copies the last structure to arrays of its size, with the indices of its place.
    pub fn copy_relocated(&self, built: &Built, place: &StructurePlace) -> Result<StructureArrays, GpuError> {
        match (&self.kernels, built) {
            (Kernels::KdTree(kernels), Built::KdTree(tree)) => kernels.copy_relocated(tree, place, BufferUse::Storage),
            (Kernels::Grid(kernels), Built::Grid(grid)) => kernels.copy_relocated(grid, place, BufferUse::Storage),
            _ => unreachable!("the last build is of the builder's kind"),
        }
    }

    /// Copies the last structure into arrays of several, without a wait for the device.
    pub fn place(&self, built: &Built, target: &Target) -> Result<(), GpuError> {
        match (&self.kernels, built) {
            (Kernels::KdTree(kernels), Built::KdTree(tree)) => kernels.place(tree, target),
            (Kernels::Grid(kernels), Built::Grid(grid)) => kernels.place(grid, target),
            _ => unreachable!("the last build is of the builder's kind"),
        }
    }
}

/// Returns the kind of the arrays of such structures on a device.
pub(super) fn kind(context: &Context, structure: LazyStructure) -> StructureKind {
    match structure {
        LazyStructure::KdTree(tree) => StructureKind::KdTree { has_slabs: has_slabs(context, tree) },
        LazyStructure::Grid(_) => StructureKind::Grid,
    }
}

/// Whether the device needs the tree's slabs. The kernels of devices that predicate branches do not read any.
fn has_slabs(context: &Context, tree: &LazyTree) -> bool {
    tree.options().slabs && !context.predicates_branches()
}

/// Returns the options with which a device builds such a tree.
pub(super) fn builder_options(context: &Context, tree: &LazyTree) -> KdTreeBuilderOptions {
    let tree = BuildOptions { slabs: has_slabs(context, tree), ..tree.options().clone() };
    KdTreeBuilderOptions { tree, ..KdTreeBuilderOptions::default() }
}
