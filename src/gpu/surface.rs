//! The surface of a window, on which pictures are shown.

use std::{ffi::CStr, sync::Arc};

use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::{GpuError, devices::queue_family, instance::Instance};

/// A window that gives access to its raw window handle and to the raw handle of its display.
pub trait WindowHandles: HasDisplayHandle + HasWindowHandle {}

impl<T: HasDisplayHandle + HasWindowHandle> WindowHandles for T {}

/// A window's surface. It keeps the window alive.
pub struct WindowSurface {
    pub(super) raw: vk::SurfaceKHR,
    pub(super) calls: khr::surface::Instance,
    _instance: Arc<Instance>,
    _window: Arc<dyn WindowHandles>,
}

impl WindowSurface {
    /// Lists the instance extensions that a surface of this window needs.
    pub(super) fn extensions(window: &dyn WindowHandles) -> Result<Vec<&'static CStr>, GpuError> {
        let display = window.display_handle().map_err(|error| GpuError::NoSurface(error.to_string()))?;
        let names = ash_window::enumerate_required_extensions(display.as_raw())
            .map_err(GpuError::call("enumerate_required_extensions", "window"))?;
        // SAFETY: the names are string literals of ash.
        Ok(names.iter().map(|name| unsafe { CStr::from_ptr(*name) }).collect())
    }

    /// Creates the surface of a window. The instance must have the extensions that the window needs.
    pub(super) fn new(instance: &Arc<Instance>, window: Arc<dyn WindowHandles>) -> Result<Self, GpuError> {
        let no_surface = |error: raw_window_handle::HandleError| GpuError::NoSurface(error.to_string());
        let display = window.display_handle().map_err(no_surface)?.as_raw();
        let handle = window.window_handle().map_err(no_surface)?.as_raw();
        // SAFETY: the handles belong to the window, which the surface keeps alive.
        let raw = unsafe { ash_window::create_surface(&instance.entry, &instance.raw, display, handle, None) }
            .map_err(GpuError::call("vkCreateSurfaceKHR", "window"))?;
        let calls = khr::surface::Instance::new(&instance.entry, &instance.raw);
        Ok(Self { raw, calls, _instance: instance.clone(), _window: window })
    }

    /// Whether a device has the swapchain extension and its queue for rendering can also present to the surface.
    pub(super) fn is_served_by(&self, instance: &Instance, device: vk::PhysicalDevice) -> bool {
        // SAFETY: the physical device belongs to the instance.
        let (families, extensions) = unsafe {
            (
                instance.raw.get_physical_device_queue_family_properties(device),
                instance.raw.enumerate_device_extension_properties(device).unwrap_or_default(),
            )
        };
        let has_swapchain = extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(khr::swapchain::NAME));
        has_swapchain && queue_family(&families).is_some_and(|family| self.is_served_by_family(device, family as u32))
    }

    fn is_served_by_family(&self, device: vk::PhysicalDevice, family: u32) -> bool {
        // SAFETY: the physical device and the surface belong to the same instance.
        unsafe { self.calls.get_physical_device_surface_support(device, family, self.raw) }.unwrap_or(false)
    }
}

impl Drop for WindowSurface {
    fn drop(&mut self) {
        // SAFETY: the swapchain of the surface is destroyed before it.
        unsafe { self.calls.destroy_surface(self.raw, None) };
    }
}
