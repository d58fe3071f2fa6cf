//! Probes: kernels that measure what Vulkan has no device property for.

use std::sync::Arc;

use super::{
    Access, Binding, BindingKind, BindingLayout, BindingSet, Buffer, BufferUse, ComputeDesc, ComputePipeline,
    Constants, Context, Dispatch, GpuError, Shader,
};

const FUSED_FMA: Shader =
    Shader { file: "fused_fma.comp", spirv: include_bytes!(concat!(env!("OUT_DIR"), "/fused_fma.comp.spv")) };

const LANES: Shader = Shader { file: "lanes.comp", spirv: include_bytes!(concat!(env!("OUT_DIR"), "/lanes.comp.spv")) };
/// Workgroup size of the lane probe. It is that of ray kernels.
const GROUP_SIZE: u32 = 64;

const LOOP_ITERATIONS: Shader = Shader {
    file: "loop_iterations.comp",
    spirv: include_bytes!(concat!(env!("OUT_DIR"), "/loop_iterations.comp.spv")),
};

/// Returns the number of loop iterations after which the driver ends a kernel, or `None` if the probe meets
/// no limit. The lavapipe of Mesa 22.3 ends every shader after 65,535 iterations, that of Mesa 25.0 does not.
pub(super) fn loop_limit(context: &Arc<Context>) -> Result<Option<u32>, GpuError> {
    // The number of iterations that the probe tries is twice the known limit.
    const N_ITERATIONS: u32 = 1 << 17;
    let counts = Buffer::with(context, "counts", &[0u32], BufferUse::Storage)?;
    let bindings = BindingLayout::new(context, &[(0, BindingKind::Storage)], 4)?;
    let set = BindingSet::new(&bindings, "loop_iterations", &[(0, Binding::Buffer(counts.any()))])?;
    let desc = ComputeDesc {
        name: "loop_iterations",
        shader: LOOP_ITERATIONS,
        constants: &Constants::new(),
        full_subgroups: false,
    };
    let kernel = ComputePipeline::new(context, &bindings, &desc)?;
    context.run("loop_iterations", |commands| {
        commands.bind(&set);
        commands.dispatch(&kernel, None, &N_ITERATIONS, Dispatch::Threads([1; 3], [1; 3]));
        commands.barrier(Access::ComputeWrite, Access::TransferRead); // counts
    })?;
    let n_iterations = counts.download()?[0];
    Ok((n_iterations < N_ITERATIONS).then_some(n_iterations))
}

/// Whether GLSL's `fma` rounds once on this device. Vulkan allows it to round twice, and software drivers do.
pub(super) fn fuses_fma(context: &Arc<Context>) -> Result<bool, GpuError> {
    // The square of this number needs 25 bits, one more than a float's significand has.
    let numbers = Buffer::with(context, "numbers", &[1.0 + 2f32.powi(-12), 0.0], BufferUse::Storage)?;
    let bindings = BindingLayout::new(context, &[(0, BindingKind::Storage)], 4)?;
    let set = BindingSet::new(&bindings, "fused_fma", &[(0, Binding::Buffer(numbers.any()))])?;
    let desc =
        ComputeDesc { name: "fused_fma", shader: FUSED_FMA, constants: &Constants::new(), full_subgroups: false };
    let kernel = ComputePipeline::new(context, &bindings, &desc)?;
    context.run("fused_fma", |commands| {
        commands.bind(&set);
        commands.dispatch(&kernel, None, &0u32, Dispatch::Threads([1; 3], [1; 3]));
        commands.barrier(Access::ComputeWrite, Access::TransferRead); // numbers
    })?;
    Ok(numbers.download()?[1] != 0.0)
}

/// Returns the number of lanes (invocations) that are resident on the device at once. The probe's kernel needs few
/// registers. It counts the workgroups that are running; the result is the greatest count, in invocations.
pub(super) fn n_lanes(context: &Arc<Context>) -> Result<u32, GpuError> {
    // The probe dispatches more workgroups than any device has room for. Each workgroup runs for some 20,000 cycles,
    // longer than the device takes to begin all of them.
    const N_GROUPS: u32 = 16_384;
    const N_ITERATIONS: u32 = 2500;
    let counts = Buffer::with(context, "counts", &[0u32; 3], BufferUse::Storage)?;
    let bindings = BindingLayout::new(context, &[(0, BindingKind::Storage)], 4)?;
    let set = BindingSet::new(&bindings, "lanes", &[(0, Binding::Buffer(counts.any()))])?;
    let desc = ComputeDesc { name: "lanes", shader: LANES, constants: &Constants::new(), full_subgroups: false };
    let kernel = ComputePipeline::new(context, &bindings, &desc)?;
    context.run("lanes", |commands| {
        commands.bind(&set);
        commands.dispatch(
            &kernel,
            None,
            &N_ITERATIONS,
            Dispatch::Threads([N_GROUPS * GROUP_SIZE, 1, 1], [GROUP_SIZE, 1, 1]),
        );
        commands.barrier(Access::ComputeWrite, Access::TransferRead); // counts
    })?;
    Ok(GROUP_SIZE * counts.download()?[1])
}
