//! The Vulkan layer: devices, memory, pipelines and commands. It knows nothing about rays.
//!
//! All of the crate's `unsafe` is here. Every handle is released by its owner's `Drop`. Commands keep what they use,
//! and the queue keeps commands until the device has ended them, so objects may be dropped at any time and in any
//! order. All threads may use a [`Context`] at once. Names that begin with `External` are Vulkan objects that the
//! library's caller owns.
//!
//! ```text
//! context ─> queue ─> in flight: commands ─> pipelines, sets ─> buffers, images
//!    └────────┴──────────────────────────────────────────────────────┴─> device ─> instance
//! ```
#![allow(unsafe_code)]

mod acceleration;
mod barrier;
mod bindings;
mod buffer;
mod commands;
mod context;
mod device;
mod devices;
mod error;
mod exchange;
mod external;
mod extras;
mod failure_injection;
mod image;
mod instance;
mod lock;
mod memory;
mod overrides;
mod pipeline;
#[cfg(feature = "view")]
mod presenter;
mod probe;
mod queue;
#[cfg(feature = "view")]
mod raw;
mod raw_device;
mod ray_tracing;
mod robustness;
mod shader;
mod specialization;
mod statistics;
#[cfg(feature = "view")]
mod surface;
#[cfg(feature = "view")]
mod swapchain;
mod timer;
#[cfg(feature = "view")]
mod window;

pub use context::ContextOptions;
pub use device::Device;
pub use devices::{DeviceInfo, DeviceSelector, chosen_device, devices};
pub use error::{CallResult, GpuError};
pub use external::{ExternalBuffer, ExternalCommands, ExternalDevice, ExternalImage, RequiredFeatures, TimelinePoint};
pub use memory::MemoryUse;

/// What kdray's other modules are built on. Its functions keep Vulkan's rules only if their callers do, and they take a
/// [`Context`](internal::Context), to which [`Device::context`] alone leads from outside of the crate.
#[doc(hidden)]
pub mod internal {
    #[cfg(feature = "view")]
    pub use super::shader::Replacements;
    pub use super::{
        acceleration::DriverAccel,
        barrier::Access,
        bindings::{Binding, BindingKind, BindingLayout, BindingSet},
        buffer::{AnyBuffer, Buffer, BufferUse, texel_bytes},
        commands::{Area, CommandBuffer, Commands, Dispatch, DrawDesc, PixelRows},
        context::Context,
        devices::Limits,
        exchange::Exchange,
        image::{Target, TargetKind},
        overrides::DeviceOverrides,
        pipeline::{ComputeDesc, ComputePipeline, RasterDesc, RasterPipeline, RasterTargets},
        queue::Submission,
        ray_tracing::{RayTracingDesc, RayTracingPipeline},
        shader::Shader,
        specialization::{Constant, ConstantValue, Constants},
        statistics::{Statistic, StatisticValue},
        timer::{Timer, TimerRow},
    };
    #[cfg(feature = "view")]
    pub use super::{
        presenter::{FRAMES_IN_FLIGHT, Presenter, WindowImage},
        surface::{WindowHandles, WindowSurface},
    };
}
#[doc(hidden)]
pub use internal::*;
