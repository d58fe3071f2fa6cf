//! Work on the session and its renderers, which a thread of its own does: a driver may compile kernels for many
//! seconds, when they are made or when they first run. The window waits for the work for a moment, as it does for
//! nearly every frame. If the work takes longer, the window goes on without the session: it shows what it has, notes
//! events for later, and can be closed.

use std::{
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    thread,
    time::{Duration, Instant},
};

use winit::{event::WindowEvent, event_loop::EventLoopProxy, keyboard::KeyCode};

use super::{error::ViewError, gpu_session::GpuSession, overlay::OverlayFrame, reload::Wake, session::Session};
use crate::gpu::{GpuError, Replacements};

/// Time for which the window waits for work before it goes on without the session.
pub const PATIENCE: Duration = Duration::from_millis(200);
/// Time for which a window that is closed waits for work, so that the work usually ends in order.
const LAST_PATIENCE: Duration = Duration::from_secs(1);
/// Time after which the window says what it waits for, and between two pictures of it.
const SAID_AFTER: Duration = Duration::from_millis(500);

/// Stack of the thread, as large as that of the main thread on Linux: drivers compile on it.
const STACK_BYTES: usize = 8 << 20;

/// The session and its renderers.
pub struct Home {
    pub session: Session,
    /// None until the device's kernels are made.
    pub gpu: Option<GpuSession>,
}

/// What the window does after the work.
pub enum Then {
    /// Draws the first frame of a device that was opened.
    Begin,
    /// Shows the frame that was drawn, in a window of this size, with the overlay.
    Show { size: (u32, u32), overlay: Option<OverlayFrame> },
    /// Notes that the scene was read again.
    Reloaded,
    /// Follows the file that was opened.
    Opened,
    /// Replaces the window's shaders, too.
    Shaders(Option<Replacements>),
}

/// What the work leaves: the session, and whether the work succeeded. An error ends the viewer, or loses the device.
pub type Returned = (Box<Home>, Result<bool, ViewError>);

/// An event that arrived while the session was away.
pub enum Later {
    Window(WindowEvent),
    Wake(Wake),
}

/// Work that is under way.
pub struct Away {
    returns: Receiver<Returned>,
    pub then: Then,
    /// What the window says that it waits for.
    what: &'static str,
    begun: Instant,
    /// When the window was drawn last.
    drawn: Instant,
    /// Whether there are pictures to save, for which a window that is closed waits.
    pub has_saves: bool,
    /// Events that are handled when the session is back.
    pub later: Vec<Later>,
    /// The error with which the window's device has failed meanwhile.
    pub error: Option<GpuError>,
}

impl Away {
    /// Starts the work on a thread of its own, which wakes the window at the end. `on_cpu`: whether no device draws.
    pub fn start(
        mut home: Box<Home>,
        then: Then,
        work: impl FnOnce(&mut Home) -> Result<bool, ViewError> + Send + 'static,
        (proxy, on_cpu): (EventLoopProxy<Wake>, bool),
    ) -> Self {
        let (send, returns) = channel();
        let has_saves = home.session.has_saves();
        let worker = thread::Builder::new().name("view".to_owned()).stack_size(STACK_BYTES);
        let begun = worker.spawn(move || {
            let result = work(&mut home);
            // An error means that the window is closed, or that the viewer has ended.
            let _ = send.send((home, result));
            let _ = proxy.send_event(Wake::Returned);
        });
        begun.expect("the system has a thread for the window");
        let what = match then {
            Then::Show { .. } if on_cpu => "drawing",
            Then::Show { .. } => "compiling or drawing",
            _ if on_cpu => "working",
            _ => "compiling shaders",
        };
        let begun = Instant::now();
        Self { returns, then, what, begun, drawn: begun, has_saves, later: Vec::new(), error: None }
    }

    /// Waits for the end of the work for some time. Returns none if the work takes longer.
    ///
    /// # Panics
    /// The work has panicked.
    pub fn wait(&self, limit: Duration) -> Option<Returned> {
        match self.returns.recv_timeout(limit) {
            Ok(returned) => Some(returned),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => panic!("the thread that draws has panicked"),
        }
    }

    /// Waits for the end of the work after the window was closed. Returns none if the work takes long, unless there
    /// are pictures to save.
    pub fn wait_to_close(&self) -> Option<Returned> {
        let saves =
            |later: &Later| matches!(later, Later::Window(event) if is_press_of(event, &[KeyCode::KeyS, KeyCode::F12]));
        let must_save = self.has_saves || self.later.iter().any(saves);
        self.wait(if must_save { Duration::MAX } else { LAST_PATIENCE })
    }

    /// Returns when the window is to be drawn again.
    pub fn next_drawing(&self) -> Instant {
        self.drawn + SAID_AFTER
    }

    /// Notes that the window is drawn. Returns what it says about the work.
    pub fn says(&mut self, now: Instant) -> Option<String> {
        self.drawn = now;
        let elapsed = now.duration_since(self.begun);
        (elapsed >= SAID_AFTER).then(|| format!("{}: {} s", self.what, elapsed.as_secs()))
    }
}

/// Returns whether the user presses one of the keys.
pub fn is_press_of(event: &WindowEvent, keys: &[KeyCode]) -> bool {
    matches!(event, WindowEvent::KeyboardInput { event, is_synthetic: false, .. }
        if event.state.is_pressed() && keys.iter().any(|key| event.physical_key == *key))
}
