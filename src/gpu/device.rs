//! The handle of a device, by which the library's callers name it.

use std::sync::Arc;

use super::{Context, ContextOptions, DeviceInfo, DeviceOverrides, ExternalDevice, GpuError, MemoryUse};

/// An open Vulkan device. A clone is a second handle to the same device, and any number of threads may use it at once.
/// The device stays open as long as there is a handle, or an engine, renderer or caster that works on it.
///
/// Safe code renders and casts. Buffers, commands and kernels need [`Device::context`], which is unsafe:
///
/// ```no_run
/// # fn main() -> Result<(), kdray::gpu::GpuError> {
/// let device = kdray::gpu::Device::open(&Default::default())?;
/// // SAFETY: the buffer is not given to a kernel.
/// let context = unsafe { device.context() };
/// let buffer = kdray::gpu::Buffer::<u32>::new(context, "numbers", 8, kdray::gpu::BufferUse::Storage)?;
/// # Ok(())
/// # }
/// ```
///
/// ```compile_fail,E0133
/// # fn main() -> Result<(), kdray::gpu::GpuError> {
/// let device = kdray::gpu::Device::open(&Default::default())?;
///
/// let context = device.context();
/// let buffer = kdray::gpu::Buffer::<u32>::new(context, "numbers", 8, kdray::gpu::BufferUse::Storage)?;
/// # Ok(())
/// # }
/// ```
#[derive(Clone)]
pub struct Device(Arc<Context>);

impl Device {
    /// Opens the device that the options name, or the best one.
    ///
    /// # Errors
    /// There is no loader, driver, device of that name or validation layer; the device lacks a feature; or a call
    /// fails.
    pub fn open(options: &ContextOptions) -> Result<Self, GpuError> {
        Context::new(options).map(Self)
    }

    /// Opens a device with the driver's own ray tracing, with which `kdray bench` compares kdray.
    ///
    /// # Errors
    /// Fails as [`Device::open`] does, or if the device lacks a ray tracing extension.
    #[doc(hidden)]
    pub fn with_ray_tracing(options: &ContextOptions) -> Result<Self, GpuError> {
        Context::with_ray_tracing(options).map(Self)
    }

    /// Uses a device that the caller has opened. The caller keeps the device, and destroys it after the last handle and
    /// all that works on it.
    ///
    /// # Errors
    /// The device lacks something that kdray needs, or a call fails.
    ///
    /// # Safety
    /// The handles belong together and live longer than the last handle. The device was created with
    /// [`RequiredFeatures`](super::RequiredFeatures), and with 64-bit atomics if `int64_atomics` says so. Whoever else
    /// uses the queue holds `queue_lock` meanwhile.
    pub unsafe fn external(device: ExternalDevice) -> Result<Self, GpuError> {
        // SAFETY: the caller guarantees it.
        unsafe { Context::on_external(device, &DeviceOverrides::default()) }.map(Self)
    }

    /// Describes the device.
    pub fn info(&self) -> &DeviceInfo {
        self.0.info()
    }

    /// Whether the driver computes on the CPU.
    pub fn is_software(&self) -> bool {
        self.0.is_software()
    }

    /// Whether a call has found the device lost, by any handle. All later work on it fails: it has to be opened again.
    pub fn is_lost(&self) -> bool {
        self.0.is_lost()
    }

    /// Lists the uses of the device's memory, the largest first. Objects of one name share an entry.
    pub fn memory(&self) -> Vec<MemoryUse> {
        self.0.memory()
    }

    /// Returns the validation layer's messages so far. There are none without validation.
    pub fn validation_messages(&self) -> Vec<String> {
        self.0.validation_messages()
    }

    /// Returns what the passes, buffers and renderers of kdray's hidden modules are made from.
    ///
    /// # Safety
    /// Kernels read without bounds checks. Whoever makes buffers and commands has to keep to what the hidden modules
    /// state of their contents, sizes and order.
    #[doc(hidden)]
    pub unsafe fn context(&self) -> &Arc<Context> {
        &self.0
    }

    /// Returns the context for safe code of kdray.
    pub(crate) fn inner(&self) -> &Arc<Context> {
        &self.0
    }
}

impl From<&Device> for Device {
    fn from(device: &Device) -> Self {
        device.clone()
    }
}

/// Whoever has a context has promised what [`Device::context`] demands.
#[doc(hidden)]
impl From<Arc<Context>> for Device {
    fn from(context: Arc<Context>) -> Self {
        Self(context)
    }
}

#[doc(hidden)]
impl From<&Arc<Context>> for Device {
    fn from(context: &Arc<Context>) -> Self {
        Self(Arc::clone(context))
    }
}
