//! Where windows can be opened, what is asked of them, and what comes of it.

use std::path::PathBuf;

use serde::Serialize;
use winit::event_loop::EventLoop;

use super::{
    app::App,
    error::ViewError,
    history::{Moving, Percentiles},
    loaded::Loaded,
    panel::Settings,
    reload::{Reloader, Wake},
    script::Script,
    session::Session,
    tour::Tour,
};
use crate::{engine::choices::Choices, gpu::ContextOptions};

/// What the viewer is asked for.
pub struct ViewOptions {
    /// The options' size is the window's at first.
    pub settings: Settings,
    pub device: ContextOptions,
    /// Whether there is an overlay; the user can hide it.
    pub overlay: bool,
    /// After which it ends; none: the user's own way.
    pub tour: Option<Tour>,
    /// Of the tour's last frame.
    pub screenshot: Option<PathBuf>,
    /// A directory for the tour's frames.
    pub record: Option<PathBuf>,
    /// Writes to the terminal.
    pub print: fn(&str),
}

/// What came of it.
#[derive(Serialize)]
pub struct ViewReport {
    pub device: String,
    /// As they were when the window was opened.
    pub choices: Choices,
    #[serde(flatten)]
    pub pace: PaceReport,
    /// What the validation layer has said.
    #[serde(skip)]
    pub validation: Vec<String>,
}

/// Milliseconds.
#[derive(Serialize)]
pub struct PaceReport {
    /// From a frame to the next.
    pub frame_ms: Option<Percentiles>,
    /// From an input to the first frame that shows it.
    pub input_to_present_ms: Option<Percentiles>,
    /// While the camera moves.
    pub moving: Option<Moving>,
}

/// A display that windows can be opened on.
pub struct Display {
    event_loop: EventLoop<Wake>,
}

impl Display {
    /// # Errors
    /// There is none.
    pub fn open() -> Result<Self, ViewError> {
        match EventLoop::with_user_event().build() {
            Ok(event_loop) => Ok(Self { event_loop }),
            Err(error) => {
                // The message begins with a place in the library's source.
                let message = error.to_string();
                let what = message.rsplit_once(": ").map_or(&*message, |(_, what)| what);
                Err(ViewError::NoDisplay(what.trim_end_matches('.').to_owned()))
            }
        }
    }

    /// Shows the scene until the user, or the tour, ends it.
    ///
    /// # Errors
    /// No window, no device that can present to it; a device that fails for good; a tour's picture that cannot be written.
    pub fn view(self, loaded: Loaded, options: ViewOptions) -> Result<ViewReport, ViewError> {
        let script =
            (options.tour.clone()).map(|tour| Script::new(tour, options.record.clone(), options.screenshot.clone()));
        let reloader = Reloader::new(loaded.path.clone(), loaded.load_options, self.event_loop.create_proxy());
        let session = Session::new(loaded, options.settings.clone(), script.is_none(), options.print);
        let mut app = App::new(session, options, script, reloader);
        self.event_loop.run_app(&mut app).map_err(|error| ViewError::Window(error.to_string()))?;
        app.report()
    }
}
