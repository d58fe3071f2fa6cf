//! Buffers of a mesh that a device deforms, and the descriptor set over them.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::binding;
use crate::{
    gpu::{AnyBuffer, Binding, BindingLayout, BindingSet, Buffer, BufferUse, Commands, Context, GpuError},
    layout::{
        BIND_DEFORM_DEFORMED, BIND_DEFORM_DELTAS, BIND_DEFORM_FACES, BIND_DEFORM_INFLUENCES, BIND_DEFORM_JOINTS,
        BIND_DEFORM_TANGENTS, BIND_DEFORM_TEXTURE_WORDS, BIND_DEFORM_TRIANGLES, BIND_DEFORM_VERTICES,
        BIND_DEFORM_WEIGHTS, CornerSurface, DeformMesh, DeformedVertex, JointInfluence, JointRow, MorphDelta, NO_WORDS,
        RestVertex, Triangle,
    },
    scene::deformation::{self, Deformation, Influence, JointMatrix, Pose, side_of},
};

/// The bindings of the descriptor set.
const BINDINGS: [u32; 10] = [
    BIND_DEFORM_VERTICES,
    BIND_DEFORM_DELTAS,
    BIND_DEFORM_INFLUENCES,
    BIND_DEFORM_JOINTS,
    BIND_DEFORM_WEIGHTS,
    BIND_DEFORM_DEFORMED,
    BIND_DEFORM_TANGENTS,
    BIND_DEFORM_FACES,
    BIND_DEFORM_TRIANGLES,
    BIND_DEFORM_TEXTURE_WORDS,
];

/// Where the triangles of a deformed mesh are written.
#[derive(Clone, Copy)]
pub struct DeformTarget<'a> {
    /// The stored triangles of a world.
    pub triangles: &'a Arc<AnyBuffer>,
    /// The row of the mesh's first triangle.
    pub first_row: u32,
    /// The world's `texture_words`, and the index of the first word of all corners; none if the world has no corners.
    pub corners: Option<(&'a Arc<AnyBuffer>, u32)>,
}

/// Buffers of a deformed mesh.
pub struct DeformBuffers {
    /// The numbers of vertices and faces, and the places of the results.
    pub mesh: DeformMesh,
    joints: Buffer<JointRow>,
    weights: Buffer<f32>,
    /// The deformed vertices.
    pub deformed: Buffer<DeformedVertex>,
    pub set: BindingSet,
}

impl DeformBuffers {
    /// Creates the layout of the set.
    ///
    /// # Errors
    /// Out of memory.
    pub fn bindings(context: &Arc<Context>) -> Result<Arc<BindingLayout>, GpuError> {
        BindingLayout::new(context, &BINDINGS.map(binding), size_of::<DeformMesh>() as u32)
    }

    /// Uploads a mesh, whose faces name the vertices of the deformation. Without tangents in the deformation, those of
    /// the world's corners stay as they are.
    ///
    /// # Errors
    /// A buffer exceeds the device's limits; out of memory.
    ///
    /// # Panics
    /// A face names a vertex that there is not, a vertex lacks influences, or the target lacks a row or its corners.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        (deformation, faces): (&Deformation, &[[u32; 3]]),
        target: DeformTarget,
    ) -> Result<Self, GpuError> {
        let n_vertices = deformation.positions.len();
        assert!(faces.as_flattened().par_iter().all(|ix| (*ix as usize) < n_vertices), "the vertices of all faces");
        let n_influences = n_vertices * deformation.n_influences;
        assert_eq!(deformation.influences.len(), n_influences, "the influences of all vertices");
        let mesh = DeformMesh {
            n_vertices: n_vertices as u32,
            n_faces: faces.len() as u32,
            n_influences: deformation.n_influences as u32,
            has_tangents: u32::from(!deformation.tangents.is_empty()),
            first_row: target.first_row,
            first_corner_word: target.first_corner_word(deformation, faces.len()),
        };
        target.check(context, faces.len())?;
        let storage = BufferUse::Storage;
        let rest: Vec<RestVertex> = (0..n_vertices).into_par_iter().map(|ix| rest_vertex(deformation, ix)).collect();
        let has_normals = !deformation.normals.is_empty();
        let delta = |delta: &deformation::MorphDelta| match has_normals {
            true => MorphDelta::from(delta),
            false => MorphDelta { normal: Vec3::ZERO, ..MorphDelta::from(delta) },
        };
        let deltas: Vec<MorphDelta> = deformation.deltas.par_iter().map(delta).collect();
        let influences: Vec<JointInfluence> = deformation.influences.iter().map(JointInfluence::from).collect();
        let n_joints = influences.iter().map(|it| it.joint as usize + 1).max().unwrap_or(0);
        let n_targets = deltas.iter().map(|it| it.target as usize + 1).max().unwrap_or(0);
        let n_tangents = if mesh.has_tangents != 0 { n_vertices } else { 0 };
        let rest = Buffer::with(context, "rest_vertices", &rest, storage)?;
        let deltas = Buffer::with(context, "morph_deltas", &deltas, storage)?;
        let influences = Buffer::with(context, "joint_influences", &influences, storage)?;
        let joints = Buffer::new(context, "joints", n_joints, storage)?;
        let weights = Buffer::new(context, "morph_weights", n_targets, storage)?;
        let deformed = Buffer::new(context, "deformed_vertices", n_vertices, storage)?;
        let tangents = Buffer::<u32>::new(context, "deformed_tangents", n_tangents, storage)?;
        let faces = Buffer::with(context, "deformed_faces", faces.as_flattened(), storage)?;
        let objects = [
            rest.any(),
            deltas.any(),
            influences.any(),
            joints.any(),
            weights.any(),
            deformed.any(),
            tangents.any(),
            faces.any(),
            target.triangles,
            // Without corners, no words are written.
            target.corners.map_or(tangents.any(), |(words, _)| words),
        ];
        let objects: Vec<_> = BINDINGS.into_iter().zip(objects.map(Binding::Buffer)).collect();
        let set = BindingSet::new(bindings, "deform", &objects)?;
        Ok(Self { mesh, joints, weights, deformed, set })
    }

    /// Records updates of the joints and weights, which the command buffer holds.
    ///
    /// # Panics
    /// The pose lacks a joint.
    pub fn set_pose(&self, commands: &Commands, pose: &Pose) {
        let joints: Vec<JointRow> = pose.joints[..self.joints.len()].iter().map(JointRow::from).collect();
        let weight = |ix: usize| pose.weights.get(ix).copied().unwrap_or(0.0);
        let weights: Vec<f32> = (0..self.weights.len()).map(weight).collect();
        commands.update_buffer(self.joints.any(), &joints);
        commands.update_buffer(self.weights.any(), &weights);
    }
}

impl DeformTarget<'_> {
    /// Returns the word of the first corner's tangent.
    fn first_corner_word(&self, deformation: &Deformation, n_faces: usize) -> u32 {
        let Some((words, begin)) = self.corners.filter(|_| !deformation.tangents.is_empty()) else { return NO_WORDS };
        let of_triangle = (size_of::<[CornerSurface; 3]>() / size_of::<u32>()) as u64;
        let first = u64::from(begin) + u64::from(self.first_row) * of_triangle;
        assert!((first + n_faces as u64 * of_triangle) * size_of::<u32>() as u64 <= words.bytes(), "the corners");
        first as u32
    }

    fn check(&self, context: &Context, n_faces: usize) -> Result<(), GpuError> {
        let end = (u64::from(self.first_row) + n_faces as u64) * size_of::<Triangle>() as u64;
        assert!(end <= self.triangles.bytes(), "the rows of the triangles");
        let limit = context.limits().storage_range;
        let bound = [Some(self.triangles), self.corners.map(|(words, _)| words)];
        match bound.into_iter().flatten().find(|buffer| buffer.bytes() > limit) {
            Some(buffer) => Err(GpuError::TooLarge { object: buffer.name().to_owned(), bytes: buffer.bytes(), limit }),
            None => Ok(()),
        }
    }
}

fn rest_vertex(deformation: &Deformation, ix: usize) -> RestVertex {
    let tangent = deformation.tangents.get(ix).copied().unwrap_or_default();
    RestVertex {
        position: deformation.positions[ix],
        first_delta: deformation.first_deltas.get(ix).copied().unwrap_or(0),
        normal: deformation.normals.get(ix).copied().unwrap_or(Vec3::ZERO),
        n_deltas: deformation.deltas_of(ix).len() as u32,
        tangent: tangent.truncate(),
        side: side_of(tangent),
    }
}

impl From<&deformation::MorphDelta> for MorphDelta {
    fn from(delta: &deformation::MorphDelta) -> Self {
        let &deformation::MorphDelta { target, position, normal, tangent } = delta;
        Self { position, target, normal, tangent, ..Self::default() }
    }
}

impl From<&Influence> for JointInfluence {
    fn from(&Influence { joint, weight }: &Influence) -> Self {
        Self { joint, weight }
    }
}

impl From<&JointMatrix> for JointRow {
    fn from(&JointMatrix { axes: [axis_x, axis_y, axis_z], translation }: &JointMatrix) -> Self {
        let [translation_x, translation_y, translation_z] = translation.to_array();
        Self { axis_x, translation_x, axis_y, translation_y, axis_z, translation_z }
    }
}
