//! The contender that traces by `VK_KHR_ray_tracing_pipeline`.

use std::{rc::Rc, sync::Arc};

use crate::{
    accel::Query,
    buffers::CastResources,
    cast::Contender,
    gpu::{
        Access, Binding, BindingKind, BindingLayout, BindingSet, Commands, Constants, Context, DriverAccel, GpuError,
        RayTracingDesc, RayTracingPipeline,
    },
    layout::{BIND_CAST_HITS, BIND_CAST_RAYS, DriverCast, constants},
    passes::spirv,
};

/// The driver's own ray tracing as a contender.
pub struct Pipeline {
    pipeline: RayTracingPipeline,
    set: BindingSet,
    driver_accel: Rc<DriverAccel>,
    resources: Rc<CastResources>,
}

impl Pipeline {
    /// Makes the pipeline, which traces the rays in `resources` through `driver_accel`.
    ///
    /// # Errors
    /// The driver refuses a shader.
    ///
    /// # Panics
    /// The context is without ray tracing.
    pub fn new(
        context: &Arc<Context>,
        driver_accel: &Rc<DriverAccel>,
        resources: &Rc<CastResources>,
        query: Query,
    ) -> Result<Self, GpuError> {
        let kinds = [(BIND_CAST_RAYS, BindingKind::Storage), (BIND_CAST_HITS, BindingKind::Storage)];
        let bindings = BindingLayout::new(context, &kinds, size_of::<DriverCast>() as u32)?;
        let buffers = [
            (BIND_CAST_RAYS, Binding::Buffer(resources.cast_rays.any())),
            (BIND_CAST_HITS, Binding::Buffer(resources.cast_hits.any())),
        ];
        let desc = RayTracingDesc {
            name: "driver",
            generation: spirv!("driver.rgen"),
            miss: spirv!("driver.rmiss"),
            closest_hit: spirv!("driver.rchit"),
            constants: Constants::new().set(constants::ANY_HIT, query == Query::Any),
        };
        Ok(Self {
            pipeline: RayTracingPipeline::new(context, &bindings, &desc)?,
            set: BindingSet::new(&bindings, "driver", &buffers)?,
            driver_accel: Rc::clone(driver_accel),
            resources: Rc::clone(resources),
        })
    }
}

impl Contender for Pipeline {
    fn name(&self) -> String {
        "driver".to_owned()
    }

    fn access(&self) -> Access {
        Access::RayTracingUpdate
    }

    fn record(&self, commands: &Commands) {
        let address = self.driver_accel.address();
        let push = DriverCast { accel_address_low: address as u32, accel_address_high: (address >> 32) as u32 };
        commands.bind(&self.set);
        commands.trace_rays(&self.pipeline, &push, self.resources.cast_rays.len() as u32);
    }

    fn resources(&self) -> &Rc<CastResources> {
        &self.resources
    }
}
