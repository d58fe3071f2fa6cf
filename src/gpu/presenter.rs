//! Presentation of frames in a window, and the objects that each frame needs until it is shown.

use std::sync::Arc;

use ash::vk;

use super::{
    Access, CommandBuffer, Commands, Context, GpuError, Submission, WindowSurface,
    swapchain::{Outcome, Swapchain, SwapchainImage, format},
};

/// Number of frames that may be recorded or drawn at a time.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Draws frames into a window and shows them.
pub struct Presenter {
    // The order of the fields is the order of their release.
    slots: [Slot; FRAMES_IN_FLIGHT],
    next_slot: usize,
    /// `None` while the window has no area.
    swapchain: Option<Swapchain>,
    /// Whether the next frame makes a new swapchain.
    stale: bool,
    vsync: bool,
    surface: WindowSurface,
    format: vk::Format,
    context: Arc<Context>,
}

/// The image of a window in which a frame is being drawn.
pub struct WindowImage {
    pub(super) extent: vk::Extent2D,
}

impl WindowImage {
    /// Returns the width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.extent.width, self.extent.height)
    }
}

impl Presenter {
    /// Creates a presenter. `vsync` makes frames wait for the screen's refresh.
    ///
    /// # Errors
    /// The window offers no image format that kdray can draw, or memory is exhausted.
    pub fn new(context: &Arc<Context>, surface: WindowSurface, vsync: bool) -> Result<Self, GpuError> {
        let format = format(context, &surface)?.format;
        Ok(Self {
            slots: [Slot::new(context)?, Slot::new(context)?],
            next_slot: 0,
            swapchain: None,
            stale: true,
            vsync,
            surface,
            format,
            context: context.clone(),
        })
    }

    /// Returns the window's image format, which pipelines that draw into the window must know.
    pub(crate) fn format(&self) -> vk::Format {
        self.format
    }

    /// Notes that the window has changed. The next frame makes new images.
    pub fn mark_stale(&mut self) {
        self.stale = true;
    }

    /// Sets whether frames wait for the screen's refresh, from the next frame on.
    pub fn set_vsync(&mut self, vsync: bool) {
        self.stale |= vsync != self.vsync;
        self.vsync = vsync;
    }

    /// Draws a frame and shows it. `body` records the draws, between the begin and the end of rendering to the
    /// window's image. The shaders of the draws see what earlier kernels wrote, and later kernels may overwrite that.
    /// `size` is the window's size, pixels. It is used if the window system does not report one. Returns false,
    /// without drawing, if the window has no area or has just changed.
    ///
    /// # Errors
    /// A call or `body` fails.
    pub fn present(
        &mut self,
        size: (u32, u32),
        body: impl FnOnce(&Commands, &WindowImage) -> Result<(), GpuError>,
    ) -> Result<bool, GpuError> {
        // A frame that failed may have left its semaphore signalled. The device waits for that signal before the
        // swapchain that gave it is replaced.
        self.slots[self.next_slot].prepare()?;
        if self.stale {
            self.renew(size)?;
        }
        let slot = &mut self.slots[self.next_slot];
        let Some(swapchain) = &self.swapchain else { return Ok(false) };
        // If the frame fails before its image is shown, the image stays acquired until a new swapchain replaces this
        // one.
        let was_stale = std::mem::replace(&mut self.stale, true);
        let (image_ix, is_suboptimal) = match swapchain.acquire(slot.acquired)? {
            Outcome::Good(image_ix) => (image_ix, false),
            Outcome::Suboptimal(image_ix) => (image_ix, true),
            Outcome::OutOfDate => return Ok(false),
        };
        slot.has_acquired = true;
        let image = &swapchain.images[image_ix];
        let shown = WindowImage { extent: swapchain.extent };
        let mut drawn = Ok(());
        let commands = CommandBuffer::record(&self.context, "window", None, |commands| {
            commands.barrier(Access::ComputeWrite, Access::FragmentRead); // the results of the frame's kernels
            commands.begin_window(image, swapchain.extent);
            drawn = body(commands, &shown);
            commands.end_window(image);
            commands.barrier(Access::FragmentRead, Access::ComputeWrite); // the next frame's kernels overwrite them
        })?;
        // An acquired image has to be shown, or else it is never released. So the frame is submitted even if `body`
        // has failed.
        slot.submit(commands, image)?;
        self.next_slot = (self.next_slot + 1) % FRAMES_IN_FLIGHT;
        let is_good = matches!(swapchain.present(image_ix)?, Outcome::Good(()));
        self.stale = was_stale || is_suboptimal || !is_good;
        drawn.map(|()| true)
    }

    /// Makes a new swapchain in place of the old one.
    fn renew(&mut self, size: (u32, u32)) -> Result<(), GpuError> {
        let old = self.swapchain.take();
        self.swapchain = Swapchain::new(&self.context, &self.surface, old.as_ref(), self.vsync, size)?;
        self.stale = self.swapchain.is_none();
        Ok(())
    }
}

impl Drop for Presenter {
    fn drop(&mut self) {
        // An error is ignored, since work that has failed has ended, too.
        let _ = self.context.queue.wait_for_presentation();
    }
}

/// The objects that one frame in flight needs.
struct Slot {
    /// Signalled when the frame's image can be drawn.
    acquired: vk::Semaphore,
    /// Whether `acquired` is signalled, or will be, and no submission waits for it yet.
    has_acquired: bool,
    /// The frame that is being drawn, if any.
    drawing: Option<Submission>,
    context: Arc<Context>,
}

impl Slot {
    fn new(context: &Arc<Context>) -> Result<Self, GpuError> {
        // SAFETY: the call only creates a semaphore, which `Drop` releases.
        let acquired = unsafe { context.device.raw.create_semaphore(&Default::default(), None) }
            .map_err(GpuError::call("vkCreateSemaphore", "acquired"))?;
        Ok(Self { acquired, has_acquired: false, drawing: None, context: context.clone() })
    }

    /// Waits until the slot's previous frame is drawn, and until no signal of `acquired` is left unwaited.
    fn prepare(&mut self) -> Result<(), GpuError> {
        if self.has_acquired {
            // The slot's previous frame failed after it had acquired its image.
            self.submit_after_acquire(&[], &[], Vec::new())?;
        }
        self.drawing.take().map_or(Ok(()), |drawing| self.context.wait_for(drawing))
    }

    /// Submits the frame's commands. [`Slot::prepare`] must have returned since the slot's last frame.
    fn submit(&mut self, commands: CommandBuffer, image: &SwapchainImage) -> Result<(), GpuError> {
        // The drawing ends with the image's transition to the presentation layout, so the signal waits for all
        // graphics stages.
        let drawn = [vk::SemaphoreSubmitInfo::default()
            .semaphore(image.drawn)
            .stage_mask(vk::PipelineStageFlags2::ALL_GRAPHICS)];
        let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands.raw())];
        self.submit_after_acquire(&buffers, &drawn, vec![commands])
    }

    fn submit_after_acquire(
        &mut self,
        buffers: &[vk::CommandBufferSubmitInfo],
        drawn: &[vk::SemaphoreSubmitInfo],
        commands: Vec<CommandBuffer>,
    ) -> Result<(), GpuError> {
        let acquired = [vk::SemaphoreSubmitInfo::default()
            .semaphore(self.acquired)
            .stage_mask(vk::PipelineStageFlags2::COLOR_ATTACHMENT_OUTPUT)];
        let submit_info = [vk::SubmitInfo2::default()
            .wait_semaphore_infos(&acquired)
            .command_buffer_infos(buffers)
            .signal_semaphore_infos(drawn)];
        self.drawing = Some(self.context.queue.submit(&submit_info, commands)?);
        self.has_acquired = false;
        Ok(())
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        // SAFETY: the presenter has waited for the device, and Vulkan ignores null handles.
        unsafe { self.context.device.raw.destroy_semaphore(self.acquired, None) };
    }
}

#[cfg(test)]
mod tests {
    use std::{
        io::{BufRead, BufReader},
        num::NonZeroU32,
        process::{Child, Command, Stdio},
        ptr::NonNull,
        sync::atomic::{AtomicBool, Ordering},
        thread,
    };

    use raw_window_handle::{
        DisplayHandle, HandleError, HasDisplayHandle, HasWindowHandle, WindowHandle, XcbDisplayHandle, XcbWindowHandle,
    };
    use x11rb::{
        connection::Connection,
        protocol::xproto::{ConfigureWindowAux, ConnectionExt as _, CreateWindowAux, WindowClass},
        wrapper::ConnectionExt as _,
        xcb_ffi::XCBConnection,
    };

    use super::*;
    use crate::gpu::ContextOptions;

    /// A window on an X server of its own.
    struct Window {
        id: u32,
        screen_ix: usize,
        connection: XCBConnection,
        server: Child,
    }

    impl Window {
        fn open() -> Arc<Self> {
            let mut server = Command::new("Xvfb")
                .args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", "320x240x24"])
                .stdout(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .expect("Xvfb, which ./setup installs");
            let mut number = String::new();
            BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
            let name = std::ffi::CString::new(format!(":{}", number.trim())).unwrap();
            let (connection, screen_ix) = XCBConnection::connect(Some(&name)).expect("a connection to Xvfb");
            let (id, root) = (connection.generate_id().unwrap(), connection.setup().roots[screen_ix].root);
            let (class, window) = (WindowClass::INPUT_OUTPUT, CreateWindowAux::new());
            connection.create_window(0, id, root, 0, 0, 64, 48, 0, class, 0, &window).unwrap();
            connection.map_window(id).unwrap();
            connection.sync().unwrap();
            Arc::new(Self { id, screen_ix, connection, server })
        }

        fn resize(&self, width: u32, height: u32) {
            let size = ConfigureWindowAux::new().width(width).height(height);
            self.connection.configure_window(self.id, &size).unwrap();
            self.connection.sync().unwrap();
        }
    }

    impl Drop for Window {
        fn drop(&mut self) {
            let _ = self.server.kill();
            let _ = self.server.wait();
        }
    }

    impl HasDisplayHandle for Window {
        fn display_handle(&self) -> Result<DisplayHandle<'_>, HandleError> {
            let connection = NonNull::new(self.connection.get_raw_xcb_connection());
            let handle = XcbDisplayHandle::new(connection, self.screen_ix as i32);
            // SAFETY: the connection lives as long as the window.
            Ok(unsafe { DisplayHandle::borrow_raw(handle.into()) })
        }
    }

    impl HasWindowHandle for Window {
        fn window_handle(&self) -> Result<WindowHandle<'_>, HandleError> {
            let handle = XcbWindowHandle::new(NonZeroU32::new(self.id).unwrap());
            // SAFETY: the window is not destroyed before the connection ends.
            Ok(unsafe { WindowHandle::borrow_raw(handle.into()) })
        }
    }

    fn presenter(window: &Arc<Window>) -> (Arc<Context>, Presenter) {
        let options = ContextOptions::new(None, true);
        let (context, surface) = Context::for_window(&options, window.clone()).expect("a device that presents");
        let presenter = Presenter::new(&context, surface, false).expect("a presenter");
        (context, presenter)
    }

    /// Shows frames until `n_shown` have been shown.
    fn show(presenter: &mut Presenter, n_shown: usize) {
        let mut n = 0;
        for _ in 0..50 * n_shown {
            n += usize::from(presenter.present((64, 48), |_, _| Ok(())).expect("a frame"));
            if n == n_shown {
                return;
            }
        }
        panic!("{n} of {n_shown} frames were shown");
    }

    #[test]
    fn a_window_is_resized_while_another_thread_submits() {
        let window = Window::open();
        let (context, mut presenter) = presenter(&window);
        let has_ended = AtomicBool::new(false);
        thread::scope(|scope| {
            let submit = || {
                let mut n_runs = 0;
                while !has_ended.load(Ordering::Relaxed) {
                    context.run("work of another thread", |_| ()).expect("a run");
                    n_runs += 1;
                }
                n_runs
            };
            let submitting = scope.spawn(submit);
            for (width, height) in [(64, 48), (200, 100), (1, 1), (320, 240), (33, 77)] {
                window.resize(width, height);
                presenter.mark_stale();
                show(&mut presenter, 10);
            }
            has_ended.store(true, Ordering::Relaxed);
            assert!(submitting.join().expect("no panic") > 10);
        });
        drop(presenter);
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }

    /// When a frame fails to record, its image is already acquired, and the semaphore of the acquire is signalled.
    #[test]
    fn frames_follow_one_that_could_not_be_recorded() {
        let window = Window::open();
        let (context, mut presenter) = presenter(&window);
        for n_before in 1..5 {
            show(&mut presenter, n_before);
            context.fail_creations_after(Some(0));
            let failed = presenter.present((64, 48), |_, _| Ok(())).expect_err("no command buffer");
            assert!(failed.is_out_of_memory(), "{failed}");
            context.fail_creations_after(None);
        }
        show(&mut presenter, 8);
        drop(presenter);
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }
}
