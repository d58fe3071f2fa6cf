//! Watches files and reports when they change.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use notify::{Event, RecommendedWatcher, RecursiveMode, Watcher};

/// Time without further changes after which a change is reported, because a file is written in several steps.
const QUIET: Duration = Duration::from_millis(120);

/// Watches files until it is dropped.
pub struct Watch {
    // Dropping the watcher closes the channel, which ends the thread.
    _watcher: RecommendedWatcher,
}

impl Watch {
    /// Calls `changed` on a thread of its own whenever any of the files is written, replaced or created. Changes that
    /// follow each other closely cause one call. The files' folders are watched, because editors replace files.
    ///
    /// # Errors
    /// The system refuses to watch.
    pub fn new(files: &BTreeSet<PathBuf>, changed: impl Fn() + Send + 'static) -> notify::Result<Self> {
        let files: BTreeSet<_> = files.iter().map(|file| absolute(file)).collect();
        let folders: BTreeSet<_> = files.iter().filter_map(|file| file.parent().map(Path::to_owned)).collect();
        let (sender, events) = channel();
        let mut watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
            let event = event.unwrap_or_default();
            if is_change(&event) && event.paths.iter().any(|path| files.contains(&absolute(path))) {
                // An error means that the watch is ending; then nothing receives.
                let _ = sender.send(());
            }
        })?;
        for folder in folders {
            watcher.watch(&folder, RecursiveMode::NonRecursive)?;
        }
        thread::Builder::new().name("watch".to_owned()).spawn(move || report(&events, changed))?;
        Ok(Self { _watcher: watcher })
    }
}

/// Calls `changed` after each burst of changes.
fn report(events: &Receiver<()>, changed: impl Fn()) {
    while events.recv().is_ok() {
        loop {
            match events.recv_timeout(QUIET) {
                Ok(()) => {}
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
        changed();
    }
}

fn is_change(event: &Event) -> bool {
    event.kind.is_modify() || event.kind.is_create()
}

/// Returns a path that can be compared with others, whether the file exists or not.
fn absolute(file: &Path) -> PathBuf {
    let (Some(folder), Some(name)) = (file.parent(), file.file_name()) else { return file.to_owned() };
    let folder = if folder == Path::new("") { Path::new(".") } else { folder };
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned()).join(name)
}

#[cfg(test)]
mod tests {
    use std::{fs, time::Instant};

    use tempfile::TempDir;

    use super::*;

    const SOON: Duration = Duration::from_secs(20);

    #[test]
    fn written_and_replaced_files_are_told_once_and_others_not() {
        let directory = TempDir::new().unwrap();
        let path = |name: &str| directory.path().join(name);
        fs::write(path("scene.toml"), "1").unwrap();
        let (sender, changes) = channel();
        let files = BTreeSet::from(["scene.toml", "later.obj"].map(path));
        let watch = Watch::new(&files, move || sender.send(()).unwrap()).unwrap();

        fs::write(path("other.toml"), "1").unwrap();
        assert_eq!(changes.recv_timeout(4 * QUIET), Err(RecvTimeoutError::Timeout));

        // If this thread is stopped between two changes, each of them is told.
        let is_told_once = || {
            let begin = Instant::now();
            fs::write(path("scene.toml"), "2").unwrap();
            fs::write(path("scene.toml"), "3").unwrap();
            let took = begin.elapsed();
            changes.recv_timeout(SOON).unwrap();
            let n_more = std::iter::from_fn(|| changes.recv_timeout(4 * QUIET).ok()).count();
            assert!(n_more == 0 || took > QUIET / 2, "{n_more} more, {took:?}");
            n_more == 0
        };
        assert!((0..100).any(|_| is_told_once()));

        fs::rename(path("other.toml"), path("scene.toml")).unwrap();
        changes.recv_timeout(SOON).unwrap();
        fs::write(path("later.obj"), "").unwrap();
        changes.recv_timeout(SOON).unwrap();
        drop(watch);
        let end = std::iter::repeat_with(|| changes.recv_timeout(SOON)).find_map(Result::err);
        assert_eq!(end, Some(RecvTimeoutError::Disconnected));
    }
}
