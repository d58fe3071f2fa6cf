//! Builds kd-trees of geometries again, one after the other: of triangles that the host has, or that the device makes
//! of a mesh in a pose.

use std::{collections::HashMap, sync::Arc};

use super::{
    deform::DeformTarget,
    device_structures::{Arrays, Geometries},
};
use crate::{
    accel::{
        DeviceBuild,
        kdtree::{BuildOptions, LazyTree},
    },
    gpu::{Access, Buffer, BufferUse, Context, GpuError, Timer},
    layout::NO_WORDS,
    passes::{
        deform::{Deform, DeformedMesh},
        kdtree::{BuiltTree, KdTreeBuilder, KdTreeBuilderOptions},
    },
    scene::deformation::{Deformation, PosedMesh},
};

/// Builds trees of geometries, one after the other.
pub(super) struct StructureBuilder {
    context: Arc<Context>,
    pub kernels: KdTreeBuilder,
    timer: Timer,
    /// What belongs to the corners of triangles, on its way to the arrays.
    pub corners: Buffer<u32>,
    /// The kernels that deform meshes, after the first one.
    deform: Option<Deform>,
    /// The meshes that have been deformed, by the indices of their geometries.
    deformed: HashMap<usize, Deformed>,
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
    /// `tree`: the options of a tree of a world.
    pub fn new(
        context: &Arc<Context>,
        (n_triangles, n_corner_words): (usize, usize),
        tree: &LazyTree,
    ) -> Result<Self, GpuError> {
        let triangles = Buffer::new(context, "kd_build_triangles", n_triangles, BufferUse::Storage)?;
        let kernels = KdTreeBuilder::new(context, &triangles, &builder_options(context, tree))?;
        let timer = Timer::new(context, kernels.n_stages())?;
        let corners = Buffer::new(context, "kd_build_corners", n_corner_words, BufferUse::Storage)?;
        let (context, deform, deformed) = (context.clone(), None, HashMap::new());
        Ok(Self { context, kernels, timer, corners, deform, deformed })
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
        self.kernels.upload(&triangles)?;
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
            let target = DeformTarget { triangles: self.kernels.triangles().any(), first_row: 0, corners };
            let mesh = deform.mesh((posed.deformation(), posed.faces()), target)?;
            let (deformation, faces) = (posed.deformation().clone(), posed.faces().clone());
            self.deformed.insert(ix, Deformed { deformation, faces, mesh });
        }
        let mesh = &self.deformed[&ix].mesh;
        let has_corners = mesh.buffers.mesh.first_corner_word != NO_WORDS;
        let n_words = if has_corners { posed.faces().len() * arrays.n_corner_words() } else { 0 };
        let bytes = |n_words: usize| (n_words * size_of::<u32>()) as u64;
        self.kernels.fill(|commands| {
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

    /// Builds the tree of the first `n_triangles` triangles that are in the builder. Returns it with its sizes, and
    /// adds the report to `reports`.
    pub fn build(
        &self,
        n_triangles: usize,
        tree: &LazyTree,
        reports: &mut Vec<DeviceBuild>,
    ) -> Result<(BuiltTree, (usize, usize)), GpuError> {
        let built = self.kernels.build_first(n_triangles, Some(&self.timer))?;
        let report = built.report(n_triangles);
        tree.note(report.clone());
        reports.push(report);
        let sizes = (built.n_nodes as usize, built.n_entries as usize);
        Ok((built, sizes))
    }
}

/// Whether the device needs the tree's slabs. The kernels of devices that predicate branches do not read any.
pub(super) fn has_slabs(context: &Context, tree: &LazyTree) -> bool {
    tree.options().slabs && !context.predicates_branches()
}

/// Returns the options with which a device builds such a tree.
pub(super) fn builder_options(context: &Context, tree: &LazyTree) -> KdTreeBuilderOptions {
    let tree = BuildOptions { slabs: has_slabs(context, tree), ..tree.options().clone() };
    KdTreeBuilderOptions { tree, ..KdTreeBuilderOptions::default() }
}
