//! Choices by a measurement of this run or of an earlier one.

use std::sync::Arc;

use super::{Cache, Candidates, Key, Methods, Timings, Workload, measure_primaries, measure_traversals};
use crate::{
    accel::kdtree::Traversal,
    frame::{Primary, RenderOptions},
    gpu::{Context, GpuError},
    world::World,
};

/// The inputs of a choice by measurement.
pub struct Trial<'a> {
    pub context: &'a Arc<Context>,
    pub world: &'a World,
    pub workload: &'a Workload,
    pub cache: &'a Cache,
}

impl Trial<'_> {
    /// Replaces the rule's traversal by one that is measurably faster, if times are known or a measurement pays off.
    pub fn choose_traversal(&self, methods: &mut Methods) -> Result<(), GpuError> {
        let n_triangles = self.world.scene().n_triangles();
        let Some(candidates) = Candidates::of_traversals(n_triangles, self.workload.n_rays) else { return Ok(()) };
        let _choosing = tracing::info_span!("choose traversal").entered();
        let measure = |traversals: &[Traversal]| unless_lost(measure_traversals(self.context, self.world, traversals));
        (methods.traversal, methods.traversal_ns) =
            candidates.choose(self.cache, &self.key(), methods.traversal.value, measure)?;
        Ok(())
    }

    /// Replaces the rule's primary visibility by one that is measurably faster, if times are known or a measurement
    /// pays off.
    pub fn choose_primary(&self, methods: &mut Methods) -> Result<(), GpuError> {
        let n_triangles = self.world.scene().n_triangles();
        let Some(candidates) = Candidates::of_primaries(n_triangles, self.workload.n_rays) else { return Ok(()) };
        let _choosing = tracing::info_span!("choose primary rays").entered();
        let ((width, height), traversal) = (self.workload.size, methods.traversal.value);
        let options = RenderOptions { width, height, traversal, ..RenderOptions::default() };
        let measure =
            |primaries: &[Primary]| unless_lost(measure_primaries(self.context, self.world, &options, primaries));
        let key = self.key().of_primaries(self.workload.size, traversal);
        (methods.primary, methods.primary_ns) = candidates.choose(self.cache, &key, methods.primary.value, measure)?;
        Ok(())
    }

    fn key(&self) -> Key {
        let scene = self.world.scene();
        let key = Key::new(self.context.info(), &scene.triangles, self.world.accel_options());
        match &scene.instances {
            Some(instances) => key.of_instances(instances),
            None => key,
        }
    }
}

/// Returns the measured times, or none if the measurement failed. A lost device remains an error.
fn unless_lost(measured: Result<Option<Timings>, GpuError>) -> Result<Option<Timings>, GpuError> {
    match measured {
        Err(error) if !error.is_device_lost() => {
            tracing::debug!("not measured: {error}");
            Ok(None)
        }
        measured => measured,
    }
}
