//! The swapchain: images of one size that a window shows in turn.

use std::{slice, sync::Arc};

use ash::{khr, vk};

use super::{Context, GpuError, WindowSurface, commands::COLOR_RANGE};

/// Number of images to request, within the surface's bounds: one is shown, one waits to be shown and one is drawn.
const N_IMAGES: u32 = 3;

/// Images of one size that are drawn and shown in turn.
pub(super) struct Swapchain {
    pub raw: vk::SwapchainKHR,
    pub images: Vec<SwapchainImage>,
    pub extent: vk::Extent2D,
    context: Arc<Context>,
}

/// An image of the swapchain.
pub(super) struct SwapchainImage {
    pub raw: vk::Image,
    pub view: vk::ImageView,
    /// Signalled when the image is drawn. The image's presentation waits for the semaphore. That this wait has ended
    /// is certain only once the image is acquired again, so each image has a semaphore of its own.
    pub drawn: vk::Semaphore,
}

/// Outcome of a call that can fail because the window has changed.
pub(super) enum Outcome<T> {
    /// The call worked.
    Good(T),
    /// The call worked, though the images no longer fit the window.
    Suboptimal(T),
    /// The call failed: new images have to be made.
    OutOfDate,
}

impl Swapchain {
    /// Creates a swapchain, or returns `None` for a window without area. `size`, in pixels, is used if the window
    /// system leaves the size to the program. `old` is retired.
    pub fn new(
        context: &Arc<Context>,
        surface: &WindowSurface,
        old: Option<&Swapchain>,
        vsync: bool,
        size: (u32, u32),
    ) -> Result<Option<Self>, GpuError> {
        // SAFETY: the surface belongs to the device's instance.
        let able =
            unsafe { surface.calls.get_physical_device_surface_capabilities(context.device.physical, surface.raw) }
                .map_err(GpuError::call("vkGetPhysicalDeviceSurfaceCapabilitiesKHR", "window"))?;
        let extent = extent(&able, size);
        if extent.width == 0 || extent.height == 0 {
            return Ok(None);
        }
        let most = if able.max_image_count == 0 { u32::MAX } else { able.max_image_count };
        let opaque = vk::CompositeAlphaFlagsKHR::OPAQUE;
        let alpha =
            if able.supported_composite_alpha.contains(opaque) { opaque } else { vk::CompositeAlphaFlagsKHR::INHERIT };
        let format = format(context, surface)?;
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface.raw)
            .min_image_count(able.min_image_count.max(N_IMAGES).min(most))
            .image_format(format.format)
            .image_color_space(format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .pre_transform(able.current_transform)
            .composite_alpha(alpha)
            .present_mode(present_mode(context, surface, vsync)?)
            .clipped(true)
            .old_swapchain(old.map_or(vk::SwapchainKHR::null(), |old| old.raw));
        let calls = calls(context);
        // SAFETY: `info` requests only what the surface offers, and `Drop` releases what was made.
        let raw =
            unsafe { calls.create_swapchain(&info, None) }.map_err(GpuError::call("vkCreateSwapchainKHR", "window"))?;
        let mut swapchain = Self { raw, images: Vec::new(), extent, context: context.clone() };
        // SAFETY: the swapchain is alive.
        let images =
            unsafe { calls.get_swapchain_images(raw) }.map_err(GpuError::call("vkGetSwapchainImagesKHR", "window"))?;
        for image in images {
            swapchain.add_image(image, format.format)?;
        }
        Ok(Some(swapchain))
    }

    fn add_image(&mut self, raw: vk::Image, format: vk::Format) -> Result<(), GpuError> {
        let device = &self.context.device.raw;
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(COLOR_RANGE);
        // SAFETY: the image belongs to the swapchain, with which the view and the semaphore are released.
        unsafe {
            let view = device.create_image_view(&info, None).map_err(GpuError::call("vkCreateImageView", "window"))?;
            let drawn = vk::Semaphore::null();
            self.images.push(SwapchainImage { raw, view, drawn });
            let info = vk::SemaphoreCreateInfo::default();
            let drawn = device.create_semaphore(&info, None).map_err(GpuError::call("vkCreateSemaphore", "drawn"))?;
            self.images.last_mut().expect("just pushed").drawn = drawn;
        }
        self.context.device.set_name(raw, &format!("window {}", self.images.len() - 1));
        Ok(())
    }

    /// Acquires the next image to draw. `acquired` is signalled when the presentation engine has released the image.
    pub fn acquire(&self, acquired: vk::Semaphore) -> Result<Outcome<usize>, GpuError> {
        // SAFETY: the semaphore is unsignalled and nothing waits for it.
        let result =
            unsafe { calls(&self.context).acquire_next_image(self.raw, u64::MAX, acquired, vk::Fence::null()) };
        match result {
            Ok((image_ix, false)) => Ok(Outcome::Good(image_ix as usize)),
            Ok((image_ix, true)) => Ok(Outcome::Suboptimal(image_ix as usize)),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(Outcome::OutOfDate),
            Err(result) => Err(GpuError::call("vkAcquireNextImageKHR", "window")(result)),
        }
    }

    /// Shows an image once it is drawn.
    pub fn present(&self, image_ix: usize) -> Result<Outcome<()>, GpuError> {
        let wait = [self.images[image_ix].drawn];
        let image_ix = image_ix as u32;
        let info = vk::PresentInfoKHR::default()
            .wait_semaphores(&wait)
            .swapchains(slice::from_ref(&self.raw))
            .image_indices(slice::from_ref(&image_ix));
        // SAFETY: the image was acquired, and a submit that signals the semaphore is under way.
        let present = |queue| unsafe { calls(&self.context).queue_present(queue, &info) };
        match self.context.queue.present(present) {
            Ok(false) => Ok(Outcome::Good(())),
            Ok(true) => Ok(Outcome::Suboptimal(())),
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => Ok(Outcome::OutOfDate),
            Err(result) => Err(GpuError::call("vkQueuePresentKHR", "window")(result)),
        }
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        // An error can be ignored: a device that is lost has ended all work.
        let _ = self.context.queue.wait_for_presentation();
        // SAFETY: the device is idle, including its work for the window. Vulkan ignores null handles.
        unsafe {
            for image in &self.images {
                self.context.device.raw.destroy_semaphore(image.drawn, None);
                self.context.device.raw.destroy_image_view(image.view, None);
            }
            calls(&self.context).destroy_swapchain(self.raw, None);
        }
    }
}

fn calls(context: &Context) -> &khr::swapchain::Device {
    context.device.presentation.as_ref().expect("a context with a surface was opened for a window")
}

/// Chooses a format of 8 bits a channel whose values are stored unchanged, since the tone mapper has already encoded
/// them for display.
pub(super) fn format(context: &Context, surface: &WindowSurface) -> Result<vk::SurfaceFormatKHR, GpuError> {
    // SAFETY: the surface belongs to the device's instance.
    let offered = unsafe { surface.calls.get_physical_device_surface_formats(context.device.physical, surface.raw) }
        .map_err(GpuError::call("vkGetPhysicalDeviceSurfaceFormatsKHR", "window"))?;
    let fits = |wanted: vk::Format| {
        let encoded = |f: &&vk::SurfaceFormatKHR| f.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR;
        offered.iter().filter(encoded).find(|f| f.format == wanted).copied()
    };
    fits(vk::Format::B8G8R8A8_UNORM)
        .or_else(|| fits(vk::Format::R8G8B8A8_UNORM))
        .ok_or_else(|| GpuError::NoSurface("it takes no images of 8 bits a channel".to_owned()))
}

/// Chooses how images are shown: at the screen's refresh with `vsync`, else as soon as possible.
fn present_mode(context: &Context, surface: &WindowSurface, vsync: bool) -> Result<vk::PresentModeKHR, GpuError> {
    // SAFETY: the surface belongs to the device's instance.
    let offered =
        unsafe { surface.calls.get_physical_device_surface_present_modes(context.device.physical, surface.raw) }
            .map_err(GpuError::call("vkGetPhysicalDeviceSurfacePresentModesKHR", "window"))?;
    let unpaced = [vk::PresentModeKHR::IMMEDIATE, vk::PresentModeKHR::MAILBOX];
    let found = unpaced.into_iter().find(|mode| !vsync && offered.contains(mode));
    // Every device supports FIFO.
    Ok(found.unwrap_or(vk::PresentModeKHR::FIFO))
}

/// Returns the size that the surface reports, pixels. If the surface takes its size from the swapchain instead,
/// returns `size`, clamped to the surface's bounds.
fn extent(able: &vk::SurfaceCapabilitiesKHR, size: (u32, u32)) -> vk::Extent2D {
    if able.current_extent.width != u32::MAX {
        return able.current_extent;
    }
    let (min, max) = (able.min_image_extent, able.max_image_extent);
    vk::Extent2D { width: size.0.min(max.width).max(min.width), height: size.1.min(max.height).max(min.height) }
}
