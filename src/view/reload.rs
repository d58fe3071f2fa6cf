//! Another version of the scene, while the one before is shown.

use std::{collections::BTreeSet, path::PathBuf, thread, time::Instant};

use winit::event_loop::EventLoopProxy;

use super::{
    error::Topic,
    live::Live,
    loaded::{LoadOptions, Loaded},
    session::Session,
    watch::Watch,
};
use crate::scene::{SceneError, source_files};

/// What wakes the viewer.
pub enum Wake {
    /// A file of the scene has changed.
    Changed,
    /// The scene was read again.
    Reloaded(Box<Result<Loaded, SceneError>>),
    /// A shader has changed.
    #[cfg(feature = "hot-reload")]
    ShadersChanged,
    /// The shaders were compiled anew.
    #[cfg(feature = "hot-reload")]
    Compiled(Result<crate::gpu::Replacements, String>),
}

/// Work that is not begun while it is under way; asked for meanwhile, it is due again.
#[derive(Default)]
pub struct OneAtATime {
    is_under_way: bool,
    is_due: bool,
}

impl OneAtATime {
    /// Whether to begin now.
    pub fn begin(&mut self) -> bool {
        self.is_due = self.is_under_way;
        !std::mem::replace(&mut self.is_under_way, true)
    }

    /// It has ended; whether it is due again.
    pub fn end(&mut self) -> bool {
        self.is_under_way = false;
        std::mem::take(&mut self.is_due)
    }
}

/// Watches the scene's files and reads them again on a thread of its own.
pub struct Reloader {
    path: PathBuf,
    load_options: LoadOptions,
    /// All that the scene has named so far.
    files: BTreeSet<PathBuf>,
    proxy: EventLoopProxy<Wake>,
    /// None where the system refuses.
    _watch: Option<Watch>,
    loading: OneAtATime,
    #[cfg(feature = "hot-reload")]
    pub shaders: super::shaders::Shaders,
}

impl Reloader {
    pub fn new(path: PathBuf, load_options: LoadOptions, proxy: EventLoopProxy<Wake>) -> Self {
        let mut reloader = Self {
            path,
            load_options,
            files: BTreeSet::new(),
            #[cfg(feature = "hot-reload")]
            shaders: super::shaders::Shaders::new(proxy.clone()),
            proxy,
            _watch: None,
            loading: OneAtATime::default(),
        };
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
        if self.loading.begin() {
            let (path, load_options, proxy) = (self.path.clone(), self.load_options, self.proxy.clone());
            let load = move || Box::new(Loaded::load(&path, load_options));
            thread::spawn(move || drop(proxy.send_event(Wake::Reloaded(load()))));
        }
    }

    /// The scene was read.
    pub fn done(&mut self) {
        self.watch();
        if self.loading.end() {
            self.load();
        }
    }
}

impl Session {
    /// Shows what was read, from where the camera is; what was not read leaves all as it is, with a message.
    pub fn replace_scene(&mut self, live: &mut Live, loaded: Result<Loaded, SceneError>) {
        let loaded = match loaded {
            Ok(loaded) => loaded,
            Err(error) => return self.complain(Topic::Scene, &error.to_string()),
        };
        match live.set_scene(&loaded) {
            Ok(()) => {
                self.controller.set_scene(loaded.scene().camera, loaded.bounds());
                self.loaded = loaded;
                self.picked = None;
                // A small picture at once.
                self.pace.moved(Instant::now());
                self.settle(Topic::Scene);
            }
            Err(error) => self.complain(Topic::Scene, &error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_is_under_way_is_begun_again_once() {
        let mut work = OneAtATime::default();
        assert!(work.begin());
        assert!(!work.begin() && !work.begin());
        assert!(work.end() && work.begin());
        assert!(!work.end());
    }
}
