//! Deformation of meshes by morph targets and joints: of a pose, only weights and the joints' transforms go to the
//! device, which writes the triangles into the world's array. [`reference::deform`](crate::reference::deform) is the
//! twin of the kernels on the CPU.
//!
//! ```text
//! deform_vertices    vertices  targets, then joints; encodes normals and tangents
//! deform_triangles   faces     rows of the world's triangles, and tangents of their corners
//! ```

use std::sync::Arc;

use super::{kernel, spirv};
use crate::{
    buffers::{DeformBuffers, DeformTarget},
    gpu::{Access, BindingLayout, Commands, ComputePipeline, Constants, Context, Dispatch, GpuError},
    layout::{GRID_GROUPS_X, SCAN_GROUP_SIZE},
    scene::deformation::{Deformation, Pose},
};

/// The pipelines of the kernels, for any number of meshes.
pub struct Deform {
    context: Arc<Context>,
    bindings: Arc<BindingLayout>,
    vertices: ComputePipeline,
    triangles: ComputePipeline,
}

/// A mesh on a device that can be deformed any number of times.
pub struct DeformedMesh {
    pub buffers: DeformBuffers,
}

impl Deform {
    /// Creates the pipelines.
    ///
    /// # Errors
    /// Out of memory; the driver refuses a shader.
    pub fn new(context: &Arc<Context>) -> Result<Self, GpuError> {
        let bindings = DeformBuffers::bindings(context)?;
        let kernel = |name, shader| kernel(context, &bindings, name, shader, &Constants::new());
        let vertices = kernel("deform_vertices", spirv!("deform_vertices.comp"))?;
        let triangles = kernel("deform_triangles", spirv!("deform_triangles.comp"))?;
        Ok(Self { context: context.clone(), bindings, vertices, triangles })
    }

    /// Uploads a mesh, whose faces name the vertices of the deformation.
    ///
    /// # Errors
    /// A buffer exceeds the device's limits; out of memory.
    ///
    /// # Panics
    /// A face names a vertex that there is not, a vertex lacks influences, or the target lacks a row or its corners.
    pub fn mesh(&self, mesh: (&Deformation, &[[u32; 3]]), target: DeformTarget) -> Result<DeformedMesh, GpuError> {
        Ok(DeformedMesh { buffers: DeformBuffers::new(&self.context, &self.bindings, mesh, target)? })
    }

    /// Deforms a mesh. Needs nothing: earlier deformations of the mesh are waited for, but not earlier uses of what is
    /// left. Leaves the mesh's rows of `triangles`, and the tangents of its corners in `texture_words`.
    ///
    /// # Panics
    /// The pose lacks a joint.
    pub fn record(&self, commands: &Commands, DeformedMesh { buffers }: &DeformedMesh, pose: &Pose) {
        let upload = || {
            commands.barrier(Access::ComputeRead, Access::TransferWrite); // joints, weights
            buffers.set_pose(commands, pose);
            commands.barrier(Access::TransferWrite, Access::ComputeRead); // joints, weights
            commands.barrier(Access::ComputeUpdate, Access::ComputeWrite); // deformed, tangents
        };
        commands.bind(&buffers.set);
        commands.dispatch_after(upload, &self.vertices, None, &buffers.mesh, over(buffers.mesh.n_vertices));
        commands.barrier(Access::ComputeWrite, Access::ComputeRead); // deformed, tangents
        commands.dispatch(&self.triangles, None, &buffers.mesh, over(buffers.mesh.n_faces));
    }
}

/// Returns the dispatch over n invocations, in rows of workgroups.
fn over(n: u32) -> Dispatch<'static> {
    let n_groups = n.div_ceil(SCAN_GROUP_SIZE);
    Dispatch::Threads([n_groups.min(GRID_GROUPS_X), n_groups.div_ceil(GRID_GROUPS_X), 1], [1, 1, 1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::passes::tests::n_contractible;

    #[test]
    fn no_arithmetic_may_be_contracted() {
        let shader = spirv!("deform_vertices.comp");
        assert_eq!(n_contractible(shader.spirv), 0, "{}", shader.file);
    }
}
