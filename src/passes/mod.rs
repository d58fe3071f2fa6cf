//! The passes of a frame, one file each, with the pipelines of the pass and the functions that record its dispatches.
//! The kernel of the same name is in `glsl/passes`, its twin on the CPU in `reference`, its test in `tests/passes`.
//! The kernels that build a grid have a folder, `grid`, and those that build a kd-tree another, `kdtree`. Those that
//! compute a kd-tree's slabs share a file, `kd_slabs`, and those that deform a mesh share `deform`.
//!
//! # Needs and leaves
//!
//! The documentation of a function that records a dispatch states its contract with other dispatches:
//!
//! - "Needs `a` and `b`." The dispatch reads these buffers. Earlier dispatches or transfers have written them, and a
//!   barrier has made them visible.
//! - "Leaves `c`." The dispatch writes this buffer. It is complete when the dispatch has ended, and a barrier must
//!   make it visible before the next dispatch reads it.
//! - "Updates `d`." The dispatch reads this buffer and writes it in place. It both needs and leaves the buffer.
//!
//! The names are those of the buffers in the kernels, which are fields of [`Resources`](crate::buffers::Resources)
//! and its parts. Not mentioned are the scene's arrays, which no pass writes, and `bounces` where it only gives a
//! pass its range of rays and the size of its dispatch. The barriers between the passes of a frame are in
//! [`plan`](crate::frame::plan). Only the builds of grids and kd-trees, the computation of slabs, the
//! deformation of meshes, the images of [`Visibility`] and the transfers within a pass have their own.

use std::sync::Arc;

use crate::{
    accel::{AccelKind, Search, kdtree::Traversal},
    buffers::uses_graphics_pipeline,
    frame::{Primary, RenderOptions},
    gpu::{
        Access, BindingLayout, Commands, ComputeDesc, ComputePipeline, Constant, Constants, Context, Dispatch,
        GpuError, Shader,
    },
    layout::{CONSTANTS_OF_SHADERS, constants},
};

mod accumulate;
mod all_hits;
mod atrous_filter;
mod auxiliary;
mod cast;
mod closest_point;
mod compact;
pub mod deform;
mod demodulate;
mod denoise;
mod device_build;
mod false_color;
mod frame_passes;
pub mod grid;
pub mod kd_slabs;
pub mod kdtree;
mod path_accumulate;
mod path_begin;
mod path_compact;
mod path_layers;
mod path_resolve;
mod path_scatter;
mod path_trace;
mod pixel_aovs;
#[cfg(feature = "view")]
mod present;
mod primary_hit;
mod rasterize;
mod record;
mod resolve;
mod shade;
mod shadow;
mod spine;
pub mod structures;
mod surface_layers;
mod tonemap;
mod trace;
mod visibility;

pub use self::{
    accumulate::Accumulate,
    all_hits::AllHits,
    atrous_filter::AtrousFilter,
    auxiliary::Auxiliary,
    cast::{Bare, Cast, Masked},
    closest_point::ClosestPoint,
    compact::Compact,
    demodulate::Demodulate,
    denoise::Denoise,
    false_color::FalseColor,
    frame_passes::{EdgePasses, FramePasses, PathPasses},
    path_accumulate::PathAccumulate,
    path_begin::PathBegin,
    path_compact::PathCompact,
    path_layers::PathLayers,
    path_resolve::PathResolve,
    path_scatter::PathScatter,
    path_trace::PathTrace,
    pixel_aovs::PixelAovs,
    primary_hit::PrimaryHit,
    rasterize::Rasterize,
    record::Inputs,
    resolve::Resolve,
    shade::Shade,
    shadow::Shadow,
    surface_layers::SurfaceLayers,
    tonemap::Tonemap,
    trace::Trace,
    visibility::Visibility,
};

#[cfg(feature = "view")]
pub use self::present::Present;

/// A shader in SPIR-V, which build.rs has compiled.
macro_rules! spirv {
    ($name:literal) => {
        $crate::gpu::Shader { file: $name, spirv: include_bytes!(concat!(env!("OUT_DIR"), "/", $name, ".spv")) }
    };
}
pub(crate) use spirv;

/// All passes of a frame that traces the paper's trees of rays. A clone shares its pipelines with the original.
#[derive(Clone)]
pub struct Passes {
    /// None unless the options have [`Primary::Raster`].
    pub visibility: Option<Arc<Visibility>>,
    /// None unless the options have [`Primary::SoftwareRaster`].
    pub rasterize: Option<Arc<Rasterize>>,
    pub primary_hit: Arc<PrimaryHit>,
    pub trace: Arc<Trace>,
    pub pixel_aovs: Arc<PixelAovs>,
    /// None unless the options ask for these layers.
    pub surface_layers: Option<Arc<SurfaceLayers>>,
    pub shadow: Arc<Shadow>,
    pub shade: Arc<Shade>,
    pub compact: Arc<Compact>,
    pub resolve: Arc<Resolve>,
    pub accumulate: Arc<Accumulate>,
    pub denoise: Arc<Denoise>,
    pub tonemap: Arc<Tonemap>,
    pub false_color: Arc<FalseColor>,
}

impl Passes {
    /// Creates the pipelines.
    ///
    /// # Errors
    /// The device lacks 64-bit atomics for [`Primary::SoftwareRaster`], or the driver refuses a shader.
    pub fn new(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            visibility: Self::new_visibility(context, bindings, options)?,
            rasterize: Self::new_rasterize(context, bindings, options)?,
            primary_hit: PrimaryHit::new(context, bindings, options)?.into(),
            trace: Trace::new(context, bindings, options)?.into(),
            pixel_aovs: PixelAovs::new(context, bindings)?.into(),
            surface_layers: SurfaceLayers::new(context, bindings, options)?,
            shadow: Shadow::new(context, bindings, options)?.into(),
            shade: Shade::new(context, bindings, options)?.into(),
            compact: Compact::new(context, bindings)?.into(),
            resolve: Resolve::new(context, bindings)?.into(),
            accumulate: Accumulate::new(context, bindings)?.into(),
            denoise: Denoise::new(context, bindings)?.into(),
            false_color: FalseColor::new(context, bindings)?.into(),
            tonemap: Tonemap::new(context, bindings, options.tonemap)?.into(),
        })
    }

    /// Returns the pass that rasterizes by the graphics pipeline.
    ///
    /// # Panics
    /// The options do not have [`Primary::Raster`].
    pub fn visibility(&self) -> &Visibility {
        self.visibility.as_ref().expect("the options ask for graphics")
    }

    /// Returns the kernels that rasterize.
    ///
    /// # Panics
    /// The options do not have [`Primary::SoftwareRaster`].
    pub fn rasterize(&self) -> &Rasterize {
        self.rasterize.as_ref().expect("the options ask for kernels that rasterize")
    }

    fn new_visibility(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Option<Arc<Visibility>>, GpuError> {
        uses_graphics_pipeline(options).then(|| Visibility::new(context, bindings).map(Arc::new)).transpose()
    }

    fn new_rasterize(
        context: &Arc<Context>,
        bindings: &Arc<BindingLayout>,
        options: &RenderOptions,
    ) -> Result<Option<Arc<Rasterize>>, GpuError> {
        (options.primary == Primary::SoftwareRaster)
            .then(|| Rasterize::new(context, bindings).map(Arc::new))
            .transpose()
    }

    /// Creates the passes for the options `to`. `self` was created for the options `from`. The new passes share with
    /// it all pipelines that do not depend on a changed option.
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
        let mut next = self.clone();
        let counts = |options: &RenderOptions| (options.profile, options.pixel_aovs);
        if (from.traversal, counts(from)) != (to.traversal, counts(to)) {
            next.shadow = Shadow::new(context, bindings, to)?.into();
        }
        if (from.traversal, from.primary, counts(from)) != (to.traversal, to.primary, counts(to)) {
            next.trace = Trace::new(context, bindings, to)?.into();
        }
        if from.profile != to.profile {
            next.shade = Shade::new(context, bindings, to)?.into();
        }
        if from.tonemap != to.tonemap {
            next.tonemap = Tonemap::new(context, bindings, to.tonemap)?.into();
        }
        if from.surface_layers != to.surface_layers {
            next.surface_layers = SurfaceLayers::new(context, bindings, to)?;
        }
        if from.primary != to.primary {
            next.visibility = Self::new_visibility(context, bindings, to)?;
            next.rasterize = Self::new_rasterize(context, bindings, to)?;
        }
        if (from.primary, counts(from)) != (to.primary, counts(to)) {
            next.primary_hit = PrimaryHit::new(context, bindings, to)?.into();
        }
        Ok(next)
    }
}

/// The modules of the kernels that find hits.
static SEARCHING: &[Shader] = include!(concat!(env!("OUT_DIR"), "/searching_modules.rs"));

/// Returns the modules of a kernel that finds hits, for every search.
pub(crate) fn modules_of(kernel: &str) -> impl Iterator<Item = Shader> {
    SEARCHING
        .iter()
        .copied()
        .filter(move |module| module.file.strip_prefix(kernel).is_some_and(|rest| rest.starts_with('_')))
}

/// Returns whether one of the constants is true for the scene.
fn is_set(bindings: &BindingLayout, any_of: impl IntoIterator<Item = Constant<bool>>) -> bool {
    any_of.into_iter().any(|constant| bindings.value(constant) != 0)
}

/// Returns the module of a kernel that finds hits: in the scene's grid, or in its kd-tree by the traversal.
/// `tests` are the constants that tell whether the kernel's rays pass through parts of triangles or back faces.
fn searching(
    kernel: &str,
    bindings: &BindingLayout,
    traversal: Traversal,
    tests: impl IntoIterator<Item = Constant<bool>>,
) -> Shader {
    let accel = AccelKind::of_grid_levels(bindings.value(constants::GRID_LEVELS));
    let search = Search::of(accel, traversal).module().expect("kernels have all searches of devices");
    let kind = match is_set(bindings, [constants::INSTANCED]) {
        true => "_instances", // which have all tests
        false if is_set(bindings, tests) => "_alpha",
        false => "",
    };
    let file = format!("{kernel}_{search}{kind}.comp");
    *SEARCHING.iter().find(|module| module.file == file).unwrap_or_else(|| panic!("build.rs makes no {file}"))
}

/// Returns the specialization constants that all kernels which find hits have in common.
fn search_constants(context: &Arc<Context>) -> Result<Constants, GpuError> {
    Ok(Constants::new()
        .set(constants::FUSED_FMA, context.fuses_fma()?)
        .set(constants::PREDICATES_BRANCHES, context.predicates_branches()))
}

/// Creates a kernel without requirements on its subgroups.
///
/// # Panics
/// `constants` has a constant that the shader does not declare.
fn kernel(
    context: &Arc<Context>,
    bindings: &Arc<BindingLayout>,
    name: &'static str,
    shader: Shader,
    constants: &Constants,
) -> Result<ComputePipeline, GpuError> {
    if let Some(unknown) = undeclared(shader.file, constants) {
        panic!("`{}` declares no constant {unknown}", shader.file);
    }
    ComputePipeline::new(context, bindings, &ComputeDesc { name, shader, constants, full_subgroups: false })
}

/// Factory of a build's kernels, for one device and one layout of bindings.
struct Kernels<'a> {
    context: &'a Arc<Context>,
    bindings: &'a Arc<BindingLayout>,
}

impl Kernels<'_> {
    /// Creates a kernel whose workgroups go through blocks of entries. It requires full subgroups.
    ///
    /// # Panics
    /// The shader does not declare one of the `constants`.
    fn of_blocks(
        &self,
        name: &'static str,
        shader: Shader,
        constants: &Constants,
    ) -> Result<ComputePipeline, GpuError> {
        assert_eq!(undeclared(shader.file, constants), None, "constants of {}", shader.file);
        let desc = ComputeDesc { name, shader, constants, full_subgroups: true };
        ComputePipeline::new(self.context, self.bindings, &desc)
    }

    /// Creates a kernel of one invocation.
    fn of_one(&self, name: &'static str, shader: Shader, constants: &Constants) -> Result<ComputePipeline, GpuError> {
        kernel(self.context, self.bindings, name, shader, constants)
    }
}

/// The size of a dispatch of one workgroup.
const ONE_GROUP: Dispatch<'static> = Dispatch::Threads([1, 1, 1], [1, 1, 1]);

/// Makes the next kernel of a build wait for the previous one, and for the sizes of dispatches that the previous one
/// has written.
fn then(commands: &Commands) {
    commands.barrier(Access::KernelUpdate, Access::KernelUpdate); // the build's arrays
}

/// Returns a constant that the shader does not declare, if there is one.
fn undeclared(file: &str, constants: &Constants) -> Option<&'static str> {
    let declared = CONSTANTS_OF_SHADERS.iter().find(|(known, _)| *known == file);
    let (_, declared) = declared.unwrap_or_else(|| panic!("`{file}` is a shader"));
    constants.names().find(|name| !declared.contains(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The opcode of a decoration in SPIR-V, and the decoration that forbids contraction.
    const OP_DECORATE: u32 = 71;
    const NO_CONTRACTION: u32 = 42;
    /// Opcodes of sums, differences and products of floats, of products of vectors and scalars and with matrices, and
    /// of the dot product.
    const ARITHMETIC: [u32; 8] = [129, 131, 133, 142, 143, 144, 145, 148];

    /// Counts the arithmetic instructions of a module that lack `NoContraction`. A device may contract these to
    /// others, which round differently.
    pub fn n_contractible(spirv: &[u8]) -> usize {
        let words: Vec<u32> = spirv.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
        let (mut results, mut exact) = (Vec::new(), Vec::new());
        let mut rest = &words[5..];
        while let [first, operands @ ..] = rest {
            match (first & 0xffff, operands) {
                (OP_DECORATE, [result, NO_CONTRACTION, ..]) => exact.push(*result),
                (op, [_, result, ..]) if ARITHMETIC.contains(&op) => results.push(*result),
                _ => {}
            }
            rest = &rest[(first >> 16) as usize..];
        }
        results.iter().filter(|result| !exact.contains(result)).count()
    }

    #[test]
    fn a_constant_that_a_shader_lacks_is_noticed() {
        let curve = Constants::new().set(constants::CURVE, 0);
        assert_eq!(undeclared("tonemap.comp", &curve), None);
        assert_eq!(undeclared("tonemap.comp", &curve.set(constants::COUNTS, true)), Some("COUNTS"));
        let fused = Constants::new().set(constants::FUSED_FMA, true);
        assert_eq!(undeclared("trace_mask.comp", &fused), None, "a shared file declares it");
    }

    #[test]
    fn every_traversal_has_its_modules() {
        for (kernel, n_of_each) in [("all_hits", 2), ("cast", 2), ("path_trace", 3), ("shadow", 3), ("trace", 3)] {
            let modules: Vec<_> = modules_of(kernel).map(|module| module.file).collect();
            let n_modules = n_of_each * (Traversal::ALL.len() + 1);
            assert_eq!(modules.len(), n_modules, "{kernel}: those of the grid, too");
            for search in Search::all(false) {
                let file = format!("{kernel}_{}.comp", search.module().unwrap());
                assert!(modules.contains(&&*file), "{file}");
            }
        }
    }
}
