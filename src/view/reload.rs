//! Reloads the scene when its files change and opens other files, while the previous scene stays on screen.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::{Duration, Instant},
};

use winit::event_loop::EventLoopProxy;

use super::{
    gpu_session::GpuSession,
    loaded_scene::{LoadSettings, LoadedScene},
    message::Topic,
    opened::Opener,
    session::Session,
    shaders::Shaders,
    watch::Watch,
};
use crate::{
    engine::LoadError,
    scene::source_files_with,
    util::progress::{Observer, Progress, Work},
};

/// Event from another thread that wakes the viewer.
pub enum Wake {
    /// A file of the scene has changed.
    Changed,
    /// The scene was read again, or could not be read.
    Reloaded(Box<Result<LoadedScene, LoadError>>),
    /// A picture was written, or could not be written.
    Saved,
    /// How far the loading of a file has come that the user opens, in words.
    Progress(String),
    /// A file that the user opens was loaded, or could not be loaded.
    Opened(Box<Result<LoadedScene, String>>),
    /// Work on the session has ended.
    Returned,
    /// A shader has changed.
    ShadersChanged,
    /// The shaders were compiled again, or could not be compiled.
    Compiled(Result<crate::gpu::Replacements, String>),
}

/// State of work that runs at most once at a time. A request while it runs makes it due once more.
#[derive(Default)]
pub struct OneAtATime {
    is_under_way: bool,
    is_due: bool,
}

impl OneAtATime {
    /// Requests the work. Returns whether to start it now; otherwise it is due after the present run.
    pub fn begin(&mut self) -> bool {
        self.is_due = self.is_under_way;
        !std::mem::replace(&mut self.is_under_way, true)
    }

    /// Notes that the work has ended. Returns whether it is due again.
    pub fn end(&mut self) -> bool {
        self.is_under_way = false;
        std::mem::take(&mut self.is_due)
    }
}

/// Watches the scene's files and reads them again on a thread of its own. Loads files that the user opens there, too.
pub struct Reloader {
    /// The scene's file; none while no file is open.
    path: Option<PathBuf>,
    load_settings: LoadSettings,
    /// All files that the scene has named so far.
    files: BTreeSet<PathBuf>,
    proxy: EventLoopProxy<Wake>,
    /// None if the system refuses to watch.
    _watch: Option<Watch>,
    opener: Opener,
    loading: OneAtATime,
    /// Whether a file of the scene has changed since the last reading began.
    is_changed: bool,
    /// The file that the user has opened last, until its loading begins.
    to_open: Option<PathBuf>,
    /// None unless shaders are compiled again when they change.
    shaders: Option<Shaders>,
}

impl Reloader {
    /// `shaders`: the checkout whose shaders are compiled again when they change, if there is one.
    pub fn new(loaded: &LoadedScene, opener: Opener, shaders: Option<&Path>, proxy: EventLoopProxy<Wake>) -> Self {
        let mut reloader = Self {
            path: loaded.path.clone(),
            load_settings: loaded.load_settings.clone(),
            files: BTreeSet::new(),
            shaders: shaders.map(|checkout| Shaders::new(checkout, proxy.clone())),
            proxy,
            _watch: None,
            opener,
            loading: OneAtATime::default(),
            is_changed: false,
            to_open: None,
        };
        reloader.watch();
        reloader
    }

    /// Watches the files that the scene names now, and those that it has named before. The latter matter while the
    /// scene cannot be read.
    fn watch(&mut self) {
        let Some(path) = &self.path else { return };
        let n_known = self.files.len();
        self.files.extend(source_files_with(path, &self.load_settings.request.scene));
        if self.files.len() == n_known {
            return;
        }
        let proxy = self.proxy.clone();
        // An error means that the viewer has ended; then nothing needs to be woken.
        let changed = move || drop(proxy.send_event(Wake::Changed));
        self._watch = Watch::new(&self.files, changed)
            .inspect_err(|error| tracing::warn!("the scene's files are not watched: {error}"))
            .ok();
    }

    /// Starts to read the scene again. If a reading is under way, another one starts when it has ended.
    pub fn load(&mut self) {
        self.is_changed = true;
        self.start();
    }

    /// Starts to compile the shaders again, if they are those of a checkout.
    pub fn compile_shaders(&mut self) {
        self.shaders.iter_mut().for_each(Shaders::compile);
    }

    /// Notes that a compilation has ended, and starts the one that is due.
    pub fn shaders_compiled(&mut self) {
        self.shaders.iter_mut().for_each(Shaders::compiled);
    }

    /// Starts to load another file, or does so when the reading that is under way has ended. Of several files, the
    /// last is loaded.
    pub fn open(&mut self, path: &Path) {
        self.to_open = Some(path.to_owned());
        self.start();
    }

    fn start(&mut self) {
        if !self.loading.begin() {
            return;
        }
        let proxy = self.proxy.clone();
        let load: Box<dyn FnOnce() -> Wake + Send> = match (self.to_open.take(), self.path.clone()) {
            (Some(path), _) => {
                let (opener, proxy) = (self.opener.clone(), Mutex::new(proxy.clone()));
                let send = move |text| {
                    drop(proxy.lock().unwrap_or_else(PoisonError::into_inner).send_event(Wake::Progress(text)));
                };
                let reporter = Reporter { path: path.clone(), begun: Instant::now(), last: Mutex::default(), send };
                Box::new(move || Wake::Opened(Box::new(opener(&path, Progress::to(Arc::new(reporter))))))
            }
            (None, Some(path)) => {
                self.is_changed = false;
                let settings = self.load_settings.clone();
                Box::new(move || Wake::Reloaded(Box::new(LoadedScene::load(&path, &settings))))
            }
            (None, None) => {
                self.loading.end();
                return;
            }
        };
        // An error means that the viewer has ended; then nothing needs to be woken.
        thread::spawn(move || drop(proxy.send_event(load())));
    }

    /// Whether a file is being read.
    pub fn is_loading(&self) -> bool {
        self.loading.is_under_way
    }

    /// Follows the changes of another scene's files from now on.
    pub fn follow(&mut self, loaded: &LoadedScene) {
        self.path.clone_from(&loaded.path);
        self.load_settings.clone_from(&loaded.load_settings);
        self.files.clear();
        self.is_changed = false;
    }

    /// Notes that a reading has ended, and starts the one that is due.
    pub fn done(&mut self) {
        self.watch();
        if self.loading.end() || self.is_changed {
            self.start();
        }
    }
}

/// Time after which the progress of loading is shown. Small files are not worth a message.
const SHOWN_AFTER: Duration = Duration::from_millis(300);

/// Says in words how far the loading of a file has come, once for each percent.
struct Reporter<F> {
    path: PathBuf,
    begun: Instant,
    last: Mutex<Option<(Work, u32)>>,
    send: F,
}

impl<F: Fn(String) + Send + Sync> Observer for Reporter<F> {
    fn progress(&self, work: Work, share: f32) {
        let percent = (100.0 * share) as u32;
        if self.begun.elapsed() < SHOWN_AFTER {
            return;
        }
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner).replace((work, percent));
        if last != Some((work, percent)) {
            let what = match work {
                Work::Reading => "reading",
                Work::Images => "images",
                Work::Building => "building",
            };
            (self.send)(format!("opening {}: {what} {percent} %", self.path.display()));
        }
    }
}

impl Session {
    /// Replaces the scene; the camera stays. If the scene could not be read or uploaded, shows a message and keeps
    /// the previous scene.
    pub fn replace_scene(&mut self, gpu: &mut GpuSession, loaded: Result<LoadedScene, LoadError>) {
        let loaded = match loaded {
            Ok(loaded) => loaded,
            Err(error) => return self.show_error(Topic::Scene, &error.to_string()),
        };
        match gpu.set_scene(&loaded) {
            Ok(()) => {
                // The camera stays where it is in the file.
                let moved = (self.loaded.scene().origin - loaded.scene().origin).as_vec3();
                self.controller.set_scene(loaded.scene().camera, loaded.built.bounds, moved);
                let before = std::mem::replace(&mut self.loaded, loaded);
                if let (Some(now), Some(before)) = (&mut self.loaded.timeline, &before.timeline) {
                    now.go_on(before);
                }
                self.picked = None;
                // The next picture is drawn small, so that it is shown at once.
                self.pace.moved(Instant::now());
                self.clear_message(Topic::Scene);
            }
            Err(error) => self.show_error(Topic::Scene, &error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_percent_is_reported_once() {
        let sent = Mutex::new(Vec::new());
        let send = |text: String| sent.lock().unwrap().push(text);
        let path = PathBuf::from("a.obj");
        let begun = Instant::now().checked_sub(2 * SHOWN_AFTER).unwrap();
        let reporter = Reporter { path: path.clone(), begun, last: Mutex::default(), send };
        for share in [0.0, 0.42, 0.424, 1.0] {
            reporter.progress(Work::Reading, share);
        }
        reporter.progress(Work::Building, 0.5);
        // A file that is loaded at once, however long this thread is stopped here.
        let begun = Instant::now() + 1000 * SHOWN_AFTER;
        Reporter { path, begun, last: Mutex::default(), send }.progress(Work::Reading, 0.5);
        let expected = ["reading 0 %", "reading 42 %", "reading 100 %", "building 50 %"];
        assert_eq!(*sent.lock().unwrap(), expected.map(|what| format!("opening a.obj: {what}")));
    }

    #[test]
    fn work_that_is_under_way_is_begun_again_once() {
        let mut work = OneAtATime::default();
        assert!(work.begin());
        assert!(!work.begin() && !work.begin());
        assert!(work.end() && work.begin());
        assert!(!work.end());
    }
}
