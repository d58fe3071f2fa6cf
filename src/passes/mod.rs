//! The passes, one file each: its pipeline and how it is recorded. The kernel of the same name is in `glsl/passes`,
//! its CPU twin in `cpu`, its test in `tests/passes`.

use std::sync::Arc;

use crate::{
    frame::{Primary, RenderOptions, Traversal},
    gpu::{BindingKind, Bindings, ComputeDesc, ComputePipeline, Context, GpuError, Shader},
    layout::{BIND_ADDRESSES, BIND_FRAME, BIND_TEXELS, BIND_TRIANGLE_IDS},
};

mod accumulate;
mod cast;
mod compact;
mod denoise;
mod false_color;
mod features;
mod pixels;
mod present;
mod primary_hit;
mod provoking;
mod queue;
mod raster;
mod rasterize;
mod resolve;
mod resources;
mod shade;
mod shadow;
mod tonemap;
mod trace;
mod tree;
mod visibility;

pub use self::{
    accumulate::Accumulate,
    cast::{Cast, CastResources},
    compact::Compact,
    denoise::Denoise,
    false_color::FalseColor,
    features::Features,
    pixels::Pixels,
    present::Present,
    primary_hit::PrimaryHit,
    queue::Queue,
    raster::Raster,
    rasterize::Rasterize,
    resolve::Resolve,
    resources::Resources,
    shade::Shade,
    shadow::Shadow,
    tonemap::Tonemap,
    trace::Trace,
    tree::{Reading, Tree},
    visibility::Visibility,
};

/// A shader, as build.rs left it.
macro_rules! spirv {
    ($name:literal) => {
        $crate::gpu::Shader { file: $name, spirv: include_bytes!(concat!(env!("OUT_DIR"), "/", $name, ".spv")) }
    };
}
pub(crate) use spirv;

/// All passes, ready to record.
pub struct Passes {
    pub visibility: Visibility,
    /// None where kernels do not rasterize.
    pub rasterize: Option<Rasterize>,
    pub primary_hit: PrimaryHit,
    pub trace: Trace,
    pub features: Features,
    pub shadow: Shadow,
    pub shade: Shade,
    pub compact: Compact,
    pub resolve: Resolve,
    pub accumulate: Accumulate,
    pub denoise: Denoise,
    pub tonemap: Tonemap,
    pub false_color: FalseColor,
}

impl Passes {
    /// # Errors
    /// The driver refuses a shader.
    pub fn new(context: &Arc<Context>, bindings: &Arc<Bindings>, options: &RenderOptions) -> Result<Self, GpuError> {
        Ok(Self {
            visibility: Visibility::new(context, bindings)?,
            rasterize: Self::rasterize(context, bindings, options)?,
            primary_hit: PrimaryHit::new(context, bindings, options)?,
            trace: Trace::new(context, bindings, options)?,
            features: Features::new(context, bindings)?,
            shadow: Shadow::new(context, bindings, options)?,
            shade: Shade::new(context, bindings, options)?,
            compact: Compact::new(context, bindings)?,
            resolve: Resolve::new(context, bindings)?,
            accumulate: Accumulate::new(context, bindings)?,
            denoise: Denoise::new(context, bindings)?,
            false_color: FalseColor::new(context, bindings)?,
            tonemap: Tonemap::new(context, bindings, options.tonemap)?,
        })
    }

    fn rasterize(
        context: &Arc<Context>,
        bindings: &Arc<Bindings>,
        options: &RenderOptions,
    ) -> Result<Option<Rasterize>, GpuError> {
        (options.primary == Primary::Compute).then(|| Rasterize::new(context, bindings)).transpose()
    }

    /// Makes the kernels anew in which the options differ.
    ///
    /// # Errors
    /// The driver refuses a shader; then all are as before.
    pub fn set_options(
        &mut self,
        context: &Arc<Context>,
        bindings: &Arc<Bindings>,
        from: &RenderOptions,
        to: &RenderOptions,
    ) -> Result<(), GpuError> {
        let counts = |options: &RenderOptions| (options.profile, options.features);
        if (from.traversal, counts(from)) != (to.traversal, counts(to)) {
            self.shadow = Shadow::new(context, bindings, to)?;
        }
        if (from.traversal, from.primary, counts(from)) != (to.traversal, to.primary, counts(to)) {
            self.trace = Trace::new(context, bindings, to)?;
        }
        if from.profile != to.profile {
            self.shade = Shade::new(context, bindings, to)?;
        }
        if from.tonemap != to.tonemap {
            self.tonemap = Tonemap::new(context, bindings, to.tonemap)?;
        }
        if from.primary != to.primary {
            self.rasterize = Self::rasterize(context, bindings, to)?;
        }
        if (from.primary, counts(from)) != (to.primary, counts(to)) {
            self.primary_hit = PrimaryHit::new(context, bindings, to)?;
        }
        Ok(())
    }
}

/// A binding number of layout.glsl and what it holds.
fn binding(number: u32) -> (u32, BindingKind) {
    let kind = match number {
        BIND_TEXELS.. => BindingKind::Texels,
        BIND_FRAME | BIND_ADDRESSES => BindingKind::Uniform,
        BIND_TRIANGLE_IDS => BindingKind::Image,
        _ => BindingKind::Storage,
    };
    (number, kind)
}

/// Specialization constants of the kernels that traverse: their own are the two in the middle, and what follows.
fn traversal_constants(context: &Arc<Context>, traversal: Traversal, own: [bool; 2]) -> Result<[u32; 5], GpuError> {
    let runs_both_sides = context.runs_both_sides();
    let [a, b] = own.map(u32::from);
    Ok([traversal.constant(), context.fuses_fma()?.into(), a, b, runs_both_sides.into()])
}

/// A kernel without subgroup requirements.
fn kernel(
    context: &Arc<Context>,
    bindings: &Arc<Bindings>,
    name: &'static str,
    shader: Shader,
    constants: &[u32],
) -> Result<ComputePipeline, GpuError> {
    ComputePipeline::new(context, bindings, &ComputeDesc { name, shader, constants, full_subgroups: false })
}
