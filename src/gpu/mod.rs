//! The Vulkan layer: devices, memory, pipelines and commands. It knows nothing about rays.
//!
//! All of the crate's `unsafe` is here. Every handle is released by its owner's `Drop`, and every owner holds the
//! [`Context`] that it was made from. A context must be used by one thread at a time. Before an object is dropped,
//! the device must have ended all work with it ([`Context::wait`]). Names that begin with `Given` are Vulkan objects
//! that the library's caller owns.
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
mod failure_injection;
mod given;
mod image;
mod instance;
mod memory;
mod overrides;
mod pipeline;
#[cfg(feature = "view")]
mod presenter;
mod probe;
#[cfg(feature = "view")]
mod raw;
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

pub use acceleration::DriverAccel;
pub use barrier::Access;
pub use bindings::{Binding, BindingKind, BindingLayout, BindingSet};
pub use buffer::{AnyBuffer, Buffer, BufferUse, texel_bytes};
pub use commands::{Area, CommandBuffer, Commands, Dispatch, DrawDesc, PixelRows};
pub use context::{Context, ContextOptions};
pub use devices::{DeviceInfo, DeviceSelector, Limits, chosen_device, devices};
pub use error::{CallResult, GpuError};
pub use given::{GivenBuffer, GivenCommands, GivenDevice, GivenImage, RequiredFeatures, TimelinePoint};
pub use image::{Target, TargetKind};
pub use memory::MemoryUse;
#[doc(hidden)]
pub use overrides::DeviceOverrides;
pub use pipeline::{ComputeDesc, ComputePipeline, RasterDesc, RasterPipeline, RasterTargets};
#[cfg(feature = "view")]
pub use presenter::{FRAMES_IN_FLIGHT, Presenter, WindowImage};
pub use ray_tracing::{RayTracingDesc, RayTracingPipeline};
#[cfg(feature = "hot-reload")]
pub use shader::Replacements;
pub use shader::Shader;
pub use specialization::{Constant, ConstantValue, Constants};
pub use statistics::{Statistic, StatisticValue};
#[cfg(feature = "view")]
pub use surface::{WindowHandles, WindowSurface};
pub use timer::{Timer, TimerRow};
