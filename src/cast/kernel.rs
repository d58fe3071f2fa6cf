//! Implementation of [`Contender`] for kdray's own cast kernels, so that they can be timed against other kernels.

use std::{rc::Rc, sync::Arc};

use super::{ALL_INSTANCES, Contender};
use crate::{
    accel::{Query, kdtree::Traversal},
    buffers::{CastResources, ResumePass},
    gpu::{Access, BindingLayout, Commands, Context, GpuError},
    passes::{Cast, Masked},
};

/// A kernel that casts rays by one traversal for one query.
pub struct Kernel {
    name: String,
    cast: Cast,
    resources: Rc<CastResources>,
}

impl Kernel {
    /// Creates the kernel. `resources` must be created for `bindings`, and must hold the rays and the links (such as
    /// ropes) that the traversal reads in addition to the tree.
    ///
    /// # Errors
    /// The driver refuses the shader.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        resources: &Rc<CastResources>,
        (traversal, query): (Traversal, Query),
    ) -> Result<Self, GpuError> {
        let cast = Cast::new(context, bindings, traversal, query)?;
        Ok(Self { name: traversal.to_string(), cast, resources: Rc::clone(resources) })
    }

    /// Returns the kernel with the name `name` in place of the traversal's name.
    #[must_use]
    pub fn named(self, name: String) -> Self {
        Self { name, ..self }
    }
}

impl Contender for Kernel {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn access(&self) -> Access {
        Access::ComputeUpdate
    }

    fn record(&self, commands: &Commands) {
        let rays = Masked { n: self.resources.cast_rays.len() as u32, mask: ALL_INSTANCES };
        self.cast.record(commands, &self.resources.set, rays, ResumePass::Begin);
    }

    fn resources(&self) -> &Rc<CastResources> {
        &self.resources
    }
}
