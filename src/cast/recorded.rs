//! A cast in a command buffer of the caller's own, over buffers of the caller's own.

use std::{rc::Rc, sync::Arc};

use super::{Caster, Hit, Ray, most_rays};
use crate::{
    accel::Query,
    buffers::{CastResources, Round, Stalls},
    gpu::{BindingSet, Context, GivenBuffer, GivenCommands, GpuError},
    passes,
};

/// A cast that is ready to be recorded, as often as the caller likes.
pub struct RecordedCast {
    context: Arc<Context>,
    kernel: Rc<passes::Cast>,
    set: BindingSet,
    stalls: Stalls,
    n_rays: u32,
}

impl Caster {
    /// Prepares a cast of rays that a program has on the device. `rays`: elements of [`Ray`]. `hits`: as many elements of
    /// [`Hit`], to be written.
    ///
    /// # Errors
    /// `hits` has too little room; more rays than a dispatch or a storage buffer can have; out of memory, a failed call.
    pub fn recorded(&mut self, rays: GivenBuffer, hits: GivenBuffer, query: Query) -> Result<RecordedCast, GpuError> {
        let n_rays = rays.bytes() / size_of::<Ray>() as u64;
        let room = (hits.bytes() / size_of::<Hit>() as u64).min(most_rays(self.context.limits()) as u64);
        if n_rays > room {
            return Err(GpuError::Limit { what: "rays of a recorded cast", value: n_rays, limit: room });
        }
        Ok(RecordedCast {
            context: Arc::clone(&self.context),
            kernel: self.prepare_kernel(query)?,
            set: CastResources::given(&self.bindings, &self.tree, rays, hits)?,
            stalls: self.tree.stalls.clone(),
            n_rays: n_rays as u32,
        })
    }
}

impl RecordedCast {
    /// Records the cast. It needs the rays to be visible to compute shaders as storage, and leaves the hits written by a
    /// compute shader: the caller records the barriers before and after it. The cast binds its own pipeline, descriptor set
    /// and push constants for compute, and its descriptor set for graphics.
    ///
    /// Only one cast of a [`Caster`] may run at a time. The cast must live until the device has run the commands.
    pub fn record(&self, commands: &GivenCommands) {
        let commands = commands.commands(&self.context);
        self.stalls.reset(&commands);
        self.kernel.record(&commands, &self.set, self.n_rays, Round::Begin);
    }

    /// Brings rays to their ends that a driver would not let run that long: to be called after the device has run the
    /// commands, before the hits are read. Most drivers need nothing, and it does nothing. Returns the number of further
    /// dispatches, for whose end it waits.
    ///
    /// # Errors
    /// A failed call.
    pub fn finish(&self) -> Result<u32, GpuError> {
        self.stalls.finish(&self.context, |commands, round| {
            self.kernel.record(commands, &self.set, self.n_rays, round);
        })
    }
}
