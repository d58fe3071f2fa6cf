//! A cast that is recorded into the caller's own command buffer, over the caller's own buffers.

use std::sync::Arc;

use super::{GpuCaster, Hit, Ray, most_rays};
use crate::{
    accel::Query,
    buffers::{CastResources, DeviceStructures, ResumePass, SuspendedRays},
    gpu::{Binding, BindingSet, Context, ExternalBuffer, ExternalCommands, GpuError},
    passes::{self, Masked},
};

/// A cast that is ready to be recorded into command buffers, any number of times. It keeps the triangles, their
/// structure and the kernel, so the caster may be dropped.
pub struct RecordedCast {
    context: Arc<Context>,
    kernel: Arc<passes::Cast>,
    set: BindingSet,
    suspended_rays: SuspendedRays,
    rays: Masked,
    /// Keeps the caster from building structures of deformed meshes in place.
    _trees: Option<Arc<DeviceStructures>>,
}

impl GpuCaster {
    /// Prepares a cast of rays in a device buffer of the caller. `rays` is filled with elements of [`Ray`]. The cast
    /// writes one [`Hit`] for each ray to `hits`.
    ///
    /// # Errors
    /// `hits` has too little room, there are more rays than a dispatch or a storage buffer can have, memory runs out,
    /// or a call fails.
    pub fn recorded(
        &mut self,
        rays: ExternalBuffer,
        hits: ExternalBuffer,
        query: Query,
    ) -> Result<RecordedCast, GpuError> {
        let n_rays = rays.bytes() / size_of::<Ray>() as u64;
        let room = (hits.bytes() / size_of::<Hit>() as u64).min(most_rays(self.context.limits()) as u64);
        if n_rays > room {
            return Err(GpuError::Limit { what: "rays of a recorded cast", value: n_rays, limit: room });
        }
        let tree = self.tree.with_own_suspended_rays(&self.context)?;
        Ok(RecordedCast {
            context: Arc::clone(&self.context),
            kernel: self.prepare_kernel(query)?,
            set: CastResources::set_over(&self.bindings, &tree, "recorded cast", [rays, hits].map(Binding::External))?,
            _trees: tree.shared(),
            suspended_rays: tree.suspended_rays,
            rays: self.masked(n_rays as u32),
        })
    }
}

impl RecordedCast {
    /// Records the cast. The caller records a barrier before it, which makes rays that the device has written
    /// visible to storage reads of compute shaders, and one after it, since a compute shader writes the hits to
    /// storage. Rays that the host has written before the submission need no barrier. The cast replaces the pipeline,
    /// descriptor set and push constants that are bound for compute, and the descriptor set for graphics.
    ///
    /// A cast may not run twice at the same time. Several casts of a [`GpuCaster`] may.
    pub fn record(&self, commands: &ExternalCommands) {
        let commands = commands.commands(&self.context);
        self.suspended_rays.reset(&commands);
        self.kernel.record(&commands, &self.set, self.rays, ResumePass::Begin);
    }

    /// Finishes the rays that stopped at the driver's limit of loop iterations. Most drivers have no such limit. The
    /// function must be called after the device has run the commands, and before the hits are read. It waits for the
    /// end of its dispatches and returns their number.
    ///
    /// # Errors
    /// A call fails.
    pub fn finish(&self) -> Result<u32, GpuError> {
        self.suspended_rays.finish(&self.context, |commands, resume_pass| {
            self.kernel.record(commands, &self.set, self.rays, resume_pass);
        })
    }
}
