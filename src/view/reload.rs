//! Another version of the scene, while the one before is shown.

use std::{collections::BTreeSet, path::PathBuf, thread, time::Instant};

use winit::event_loop::EventLoopProxy;

use super::{live::Live, loaded::Loaded, session::Session, watch::Watch};
use crate::scene::{SceneError, source_files};

/// What wakes the viewer.
pub enum Wake {
    /// A file of the scene has changed.
    Changed,
    /// The scene was read again.
    Reloaded(Box<Result<Loaded, SceneError>>),
}

/// Watches the scene's files and reads them again on a thread of its own.
pub struct Reloader {
    path: PathBuf,
    /// All that the scene has named so far.
    files: BTreeSet<PathBuf>,
    proxy: EventLoopProxy<Wake>,
    /// None where the system refuses.
    _watch: Option<Watch>,
    is_loading: bool,
    is_stale: bool,
}

impl Reloader {
    pub fn new(path: PathBuf, proxy: EventLoopProxy<Wake>) -> Self {
        let mut reloader =
            Self { path, files: BTreeSet::new(), proxy, _watch: None, is_loading: false, is_stale: false };
        reloader.watch();
        reloader
    }

    /// Watches the files that the scene names now, and those that it named while it could be read.
    fn watch(&mut self) {
        let n_known = self.files.len();
        self.files.extend(source_files(&self.path));
        if self.files.len() == n_known {
            return;
        }
        let proxy = self.proxy.clone();
        // There may be no viewer left to wake.
        let changed = move || drop(proxy.send_event(Wake::Changed));
        self._watch = Watch::new(&self.files, changed)
            .inspect_err(|error| tracing::warn!("the scene's files are not watched: {error}"))
            .ok();
    }

    /// Begins to read the scene again, or does so once it is read that is being read.
    pub fn load(&mut self) {
        if self.is_loading {
            self.is_stale = true;
            return;
        }
        self.is_loading = true;
        let (path, proxy) = (self.path.clone(), self.proxy.clone());
        thread::spawn(move || drop(proxy.send_event(Wake::Reloaded(Box::new(Loaded::load(&path))))));
    }

    /// The scene was read.
    pub fn done(&mut self) {
        self.is_loading = false;
        self.watch();
        if std::mem::take(&mut self.is_stale) {
            self.load();
        }
    }
}

impl Session {
    /// Shows what was read, from where the camera is; what was not read leaves all as it is, with a message.
    pub fn replace_scene(&mut self, live: &mut Live, loaded: Result<Loaded, SceneError>) {
        let loaded = match loaded {
            Ok(loaded) => loaded,
            Err(error) => return self.complain(&error.to_string()),
        };
        match live.set_scene(&loaded) {
            Ok(()) => {
                self.controller.set_scene(loaded.scene.camera, loaded.bounds());
                self.loaded = loaded;
                self.picked = None;
                // A small picture at once.
                self.pace.moved(Instant::now());
                self.message = None;
            }
            Err(error) => self.complain(&error.to_string()),
        }
    }
}
