//! What a device does that no property tells.

use std::sync::Arc;

use super::{
    Access, Binding, BindingKind, BindingSet, Bindings, Buffer, BufferUse, ComputeDesc, ComputePipeline, Context,
    Dispatch, GpuError, Shader,
};

const FUSED_FMA: Shader =
    Shader { file: "fused_fma.comp", spirv: include_bytes!(concat!(env!("OUT_DIR"), "/fused_fma.comp.spv")) };

/// Whether GLSL's `fma` rounds once on this device. Vulkan allows it to round twice, and software drivers do.
pub(super) fn fuses_fma(context: &Arc<Context>) -> Result<bool, GpuError> {
    // Its square needs 25 bits.
    let numbers = Buffer::with(context, "numbers", &[1.0 + 2f32.powi(-12), 0.0], BufferUse::Storage)?;
    let bindings = Bindings::new(context, &[(0, BindingKind::Storage)], 4)?;
    let set = BindingSet::new(&bindings, "fused_fma", &[(0, Binding::Buffer(numbers.any()))])?;
    let desc = ComputeDesc { name: "fused_fma", shader: FUSED_FMA, constants: &[], full_subgroups: false };
    let kernel = ComputePipeline::new(context, &bindings, &desc)?;
    context.run("fused_fma", |commands| {
        commands.bind(&set);
        commands.dispatch(&kernel, None, &0u32, Dispatch::Threads([1; 3], [1; 3]));
        commands.barrier(Access::ComputeWrite, Access::TransferRead); // numbers
    })?;
    Ok(numbers.download()?[1] != 0.0)
}
