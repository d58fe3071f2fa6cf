//! The viewer's entry point: a display, the viewer's options, and its report.

use std::path::PathBuf;

use serde::Serialize;
use winit::event_loop::EventLoop;

use super::{
    app::App,
    error::ViewError,
    history::{Moving, Percentiles},
    loaded_scene::LoadedScene,
    opened::Opener,
    panel::Settings,
    reload::{Reloader, Wake},
    saver::Saver,
    script::Script,
    session::Session,
    tour::Tour,
};
use crate::{engine::choices::Choices, gpu::ContextOptions};

/// Options of the viewer.
pub struct ViewOptions {
    /// Initial settings. The size in their render options is the window's initial size.
    pub settings: Settings,
    /// The device to use.
    pub device: ContextOptions,
    /// Whether the CPU engine draws. The device then only shows its pictures.
    pub on_cpu: bool,
    /// Whether the panel is shown at first. The user can show and hide it.
    pub overlay: bool,
    /// Camera tour, after which the viewer ends. Without one, the user moves the camera.
    pub tour: Option<Tour>,
    /// File for the picture of the tour's last frame.
    pub screenshot: Option<PathBuf>,
    /// Directory for the pictures of all frames of the tour.
    pub record: Option<PathBuf>,
    /// Loads the files that the user opens.
    pub opener: Opener,
    /// Checkout of kdray whose shaders are compiled again when they change.
    pub shaders: Option<PathBuf>,
    /// Prints text to the terminal.
    pub print: fn(&str),
}

/// Report of the viewer after it has ended.
#[derive(Serialize)]
pub struct ViewReport {
    /// The device's name.
    pub device: String,
    /// Choices made when the window was opened; none if it was closed before.
    pub choices: Option<Choices>,
    /// Frame times and latencies.
    #[serde(flatten)]
    pub pace: PaceReport,
    /// Messages of the validation layer.
    #[serde(skip)]
    pub validation: Vec<String>,
    /// Whether the window was closed while a driver was compiling. The driver still does, on a thread of its own, so
    /// the process should end without releasing what drivers use.
    #[serde(skip)]
    pub is_abandoned: bool,
}

/// Frame times and latencies, milliseconds. Each is none if there were no such frames.
#[derive(Serialize)]
pub struct PaceReport {
    /// Time from one frame to the next.
    pub frame_ms: Option<Percentiles>,
    /// Time from an input until the first frame that shows it was handed to the screen.
    pub input_to_present_ms: Option<Percentiles>,
    /// Size and times of frames that were drawn while the camera moved.
    pub moving: Option<Moving>,
}

/// A display that windows can be opened on.
pub struct Display {
    event_loop: EventLoop<Wake>,
}

impl Display {
    /// Connects to the system's display.
    ///
    /// # Errors
    /// There is no display.
    pub fn open() -> Result<Self, ViewError> {
        match EventLoop::with_user_event().build() {
            Ok(event_loop) => Ok(Self { event_loop }),
            Err(error) => {
                // The library's message begins with a position in its source, which is left out.
                let message = error.to_string();
                let what = message.rsplit_once(": ").map_or(&*message, |(_, what)| what);
                Err(ViewError::NoDisplay(what.trim_end_matches('.').to_owned()))
            }
        }
    }

    /// Shows the scene until the user, or the tour, ends it.
    ///
    /// # Errors
    /// The window cannot be opened, no device can present to it, the device fails and cannot be opened again, or a
    /// tour's picture cannot be written.
    pub fn view(self, loaded: LoadedScene, options: ViewOptions) -> Result<ViewReport, ViewError> {
        let script =
            (options.tour.clone()).map(|tour| Script::new(tour, options.record.clone(), options.screenshot.clone()));
        let (opener, shaders) = (options.opener.clone(), options.shaders.as_deref());
        let reloader = Reloader::new(&loaded, opener, shaders, self.event_loop.create_proxy());
        let proxy = self.event_loop.create_proxy();
        // An error means that the viewer has ended; then nothing needs to be woken.
        let saver = Saver::new(move || drop(proxy.send_event(Wake::Saved)));
        let session = Session::new(loaded, options.settings.clone(), script.is_none(), (options.print, saver));
        let mut app = App::new(session, options, script, reloader, self.event_loop.create_proxy());
        self.event_loop.run_app(&mut app).map_err(|error| ViewError::Window(error.to_string()))?;
        app.report()
    }
}
