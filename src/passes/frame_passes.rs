//! The passes of a frame of either integrator.

use std::sync::Arc;

use super::{
    AtrousFilter, Auxiliary, Demodulate, Denoise, FalseColor, Inputs, Passes, PathAccumulate, PathBegin, PathCompact,
    PathLayers, PathResolve, PathScatter, PathTrace, PixelAovs, SurfaceLayers, Tonemap, record::record_entries,
};
use crate::{
    buffers::Resources,
    frame::{Integrator, Pass, PlanEntry, RenderOptions},
    gpu::{BindingLayout, Commands, Context, GpuError},
};

/// The passes of a frame. A clone shares its pipelines with the original.
#[derive(Clone)]
pub enum FramePasses {
    /// Those of [`Integrator::Whitted`].
    Whitted(Passes),
    /// Those of [`Integrator::Path`].
    Path(PathPasses),
}

impl FramePasses {
    /// Creates the pipelines.
    ///
    /// # Errors
    /// Fails as [`Passes::new`] does.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        match options.integrator {
            Integrator::Whitted => Passes::new(context, bindings, options).map(Self::Whitted),
            Integrator::Path => PathPasses::new(context, bindings, options).map(Self::Path),
        }
    }

    /// Creates the passes for the options `to`, which have the same integrator. `self` was created for the options
    /// `from`. The new passes share with it all pipelines that do not depend on a changed option.
    ///
    /// # Errors
    /// Fails as [`Passes::new`] does.
    pub fn with_options(
        &self,
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        from: &RenderOptions,
        to: &RenderOptions,
    ) -> Result<Self, GpuError> {
        match self {
            Self::Whitted(passes) => passes.with_options(context, bindings, from, to).map(Self::Whitted),
            Self::Path(passes) => passes.with_options(context, bindings, from, to).map(Self::Path),
        }
    }

    /// Records passes and the barriers between them. The resources must be bound.
    pub fn record_sequence(&self, commands: &Commands, resources: &Resources, sequence: &[PlanEntry], inputs: &Inputs) {
        match self {
            Self::Whitted(passes) => passes.record_sequence(commands, resources, sequence, inputs),
            Self::Path(passes) => passes.record_sequence(commands, resources, sequence, inputs),
        }
    }
}

/// The passes of the noise filter `edge`.
pub struct EdgePasses {
    pub auxiliary: Auxiliary,
    pub demodulate: Demodulate,
    pub atrous_filter: AtrousFilter,
}

impl EdgePasses {
    fn new(context: &Arc<Context>, bindings: &Arc<BindingLayout>) -> Result<Self, GpuError> {
        Ok(Self {
            auxiliary: Auxiliary::new(context, bindings)?,
            demodulate: Demodulate::new(context, bindings)?,
            atrous_filter: AtrousFilter::new(context, bindings)?,
        })
    }
}

/// All passes of a frame that traces paths. A clone shares its pipelines with the original.
#[derive(Clone)]
pub struct PathPasses {
    pub path_begin: Arc<PathBegin>,
    pub path_trace: Arc<PathTrace>,
    pub path_scatter: Arc<PathScatter>,
    pub path_compact: Arc<PathCompact>,
    /// None unless the options ask for layers of light.
    pub path_layers: Option<Arc<PathLayers>>,
    /// None unless the options ask for these layers.
    pub surface_layers: Option<Arc<SurfaceLayers>>,
    pub path_resolve: Arc<PathResolve>,
    pub path_accumulate: Arc<PathAccumulate>,
    pub pixel_aovs: Arc<PixelAovs>,
    pub denoise: Arc<Denoise>,
    pub edge: Arc<EdgePasses>,
    pub tonemap: Arc<Tonemap>,
    pub false_color: Arc<FalseColor>,
}

impl PathPasses {
    /// Creates the pipelines.
    ///
    /// # Errors
    /// The driver refuses a shader.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            path_begin: PathBegin::new(context, bindings)?.into(),
            path_trace: PathTrace::new(context, bindings, options)?.into(),
            path_scatter: PathScatter::new(context, bindings)?.into(),
            path_compact: PathCompact::new(context, bindings)?.into(),
            path_layers: path_layers(context, bindings, options)?,
            surface_layers: SurfaceLayers::new(context, bindings, options)?,
            path_resolve: PathResolve::new(context, bindings)?.into(),
            path_accumulate: PathAccumulate::new(context, bindings)?.into(),
            pixel_aovs: PixelAovs::new(context, bindings)?.into(),
            denoise: Denoise::new(context, bindings)?.into(),
            edge: EdgePasses::new(context, bindings)?.into(),
            tonemap: Tonemap::new(context, bindings, options.tonemap)?.into(),
            false_color: FalseColor::new(context, bindings)?.into(),
        })
    }

    fn with_options(
        &self,
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        from: &RenderOptions,
        to: &RenderOptions,
    ) -> Result<Self, GpuError> {
        let mut next = self.clone();
        let of_trace = |options: &RenderOptions| (options.traversal, options.profile, options.pixel_aovs);
        if of_trace(from) != of_trace(to) {
            next.path_trace = PathTrace::new(context, bindings, to)?.into();
        }
        if from.tonemap != to.tonemap {
            next.tonemap = Tonemap::new(context, bindings, to.tonemap)?.into();
        }
        if from.light_layers != to.light_layers {
            next.path_layers = path_layers(context, bindings, to)?;
        }
        if from.mean_layers() != to.mean_layers() {
            next.surface_layers = SurfaceLayers::new(context, bindings, to)?;
        }
        Ok(next)
    }

    /// Records passes and the barriers between them. The resources must be bound.
    pub fn record_sequence(&self, commands: &Commands, resources: &Resources, sequence: &[PlanEntry], inputs: &Inputs) {
        record_entries(commands, sequence, |pass, nth| self.record(commands, resources, (pass, nth), inputs));
    }

    /// Records one pass. `nth`: how often the sequence has run the pass before. The resources must be bound.
    ///
    /// # Panics
    /// Frames of paths do not have `pass`, or `inputs` lacks the AOVs that it displays.
    fn record(&self, commands: &Commands, resources: &Resources, (pass, nth): (Pass, u32), inputs: &Inputs) {
        let batch = &inputs.batch;
        match pass {
            Pass::PathBegin => self.path_begin.record(commands, resources, batch),
            Pass::PathTrace => self.path_trace.record(commands, resources, batch),
            Pass::PathScatter => self.path_scatter.record(commands, resources, batch),
            Pass::CompactSpine => self.path_compact.spine.record(commands, batch),
            Pass::PathCompact => self.path_compact.record(commands, resources, batch),
            Pass::PathLayers => {
                self.path_layers.as_ref().expect("the options ask for layers of light").record(commands, batch);
            }
            Pass::SurfaceLayers => {
                self.surface_layers.as_ref().expect("the options ask for these layers").record(commands, batch);
            }
            Pass::PathResolve => self.path_resolve.record(commands, batch),
            Pass::PathAccumulate => self.path_accumulate.record(commands, resources),
            Pass::PixelAovs => self.pixel_aovs.record(commands, batch),
            Pass::Denoise => self.denoise.record(commands, resources),
            Pass::Auxiliary => self.edge.auxiliary.record(commands, batch),
            Pass::Demodulate => self.edge.demodulate.record(commands, resources),
            Pass::AtrousFilter => self.edge.atrous_filter.record(commands, resources, nth),
            Pass::FalseColor => self.false_color.record(commands, resources, inputs.displayed_aovs()),
            Pass::Tonemap => self.tonemap.record(commands, resources),
            _ => panic!("a frame of paths has no `{}`", pass.name()),
        }
    }
}

fn path_layers(
    context: &Arc<Context>,
    bindings: &Arc<BindingLayout>,
    options: &RenderOptions,
) -> Result<Option<Arc<PathLayers>>, GpuError> {
    let wants = options.has_light_layers();
    wants.then(|| PathLayers::new(context, bindings).map(Arc::new)).transpose()
}
