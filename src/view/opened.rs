//! Opening another file in the window.

use std::{path::Path, sync::Arc, time::Instant};

use super::{
    budget::{Budget, N_BUDGETS},
    controller::Controller,
    gpu_session::GpuSession,
    loaded_scene::LoadedScene,
    message::{Message, Topic},
    session::Session,
};
use crate::{frame::Profile, util::progress::Progress};

/// Loads a file that the user opens in the window, and reports the progress. It runs on a thread of its own. The error
/// is a message for people.
pub type Opener = Arc<dyn Fn(&Path, Progress) -> Result<LoadedScene, String> + Send + Sync>;

impl Session {
    /// Shows that a file is being opened.
    pub fn note_opening(&mut self, path: &Path) {
        self.message = Some(Message::note(Topic::Scene, &format!("opening {} ...", path.display())));
    }

    /// Shows how far the opening of a file has come.
    pub fn note_progress(&mut self, text: &str) {
        self.message = Some(Message::note(Topic::Scene, text));
    }

    /// Replaces the scene by another file's and looks from that file's camera. Returns whether it succeeds. If the
    /// file could not be loaded or uploaded, shows a message and keeps the previous scene.
    pub fn open_scene(&mut self, gpu: &mut GpuSession, opened: Result<LoadedScene, String>) -> bool {
        // A save that is due is of the scene that is seen.
        self.save_as_it_is(gpu);
        // The size of the options is not used, since pictures have the window's size.
        let uploaded = opened.and_then(|loaded| {
            let options = gpu.open_scene(&loaded).map_err(|error| error.to_string())?;
            Ok((loaded, options))
        });
        let (loaded, options) = match uploaded {
            Ok(uploaded) => uploaded,
            Err(message) => {
                self.show_error(Topic::Scene, &message);
                return false;
            }
        };
        self.controller = Controller::new(loaded.scene().camera, loaded.built.bounds);
        self.settings.options = options;
        self.loaded = loaded;
        self.picked = None;
        self.profile = Profile::default();
        // The times and the buffers of the previous scene say nothing about this one.
        self.budgets = [(); N_BUDGETS].map(|()| Budget::new(self.settings.budget_ms));
        self.rooms = Default::default();
        self.pace.moved(Instant::now());
        self.clear_message(Topic::Scene);
        true
    }
}
