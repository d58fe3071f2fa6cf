//! Writes pictures to files on a thread of its own, one after the other, so that the window never waits for a disk.

use std::{
    path::{Path, PathBuf},
    sync::mpsc::{Receiver, Sender, channel},
    thread::{self, JoinHandle},
};

use crate::{
    frame::Picture,
    output::{self, OutputError},
};

/// A picture that is to be written, and the name of its scene.
struct Job {
    scene_name: String,
    picture: Picture,
}

/// The file that was written, or the reason why it was not.
pub type Saved = Result<PathBuf, OutputError>;

/// Writes pictures on a thread of its own. Dropping it waits until all have been written.
pub struct Saver {
    /// None once no more pictures are taken.
    jobs: Option<Sender<Job>>,
    results: Receiver<Saved>,
    /// Number of pictures whose results have not been taken.
    n_open: usize,
    /// None once the thread has ended.
    thread: Option<JoinHandle<()>>,
}

impl Saver {
    /// Starts the thread. It calls `wake` after each picture.
    pub fn new(wake: impl Fn() + Send + 'static) -> Self {
        Self::with(write_to_next_free, wake)
    }

    fn with(write: impl Fn(&Job) -> Saved + Send + 'static, wake: impl Fn() + Send + 'static) -> Self {
        let (jobs, to_do) = channel::<Job>();
        let (done, results) = channel();
        let work = move || {
            for job in to_do {
                // An error means that nobody waits for the result any more.
                let _ = done.send(write(&job));
                wake();
            }
        };
        Self { jobs: Some(jobs), results, n_open: 0, thread: Some(thread::spawn(work)) }
    }

    /// Hands over a picture, which is written as PNG to the first path `NAME-001.png`, `NAME-002.png` and so on that
    /// does not exist. NAME is that of the scene.
    pub fn save(&mut self, scene_name: &str, picture: Picture) {
        self.n_open += 1;
        let jobs = self.jobs.as_ref().expect("a saver that has not ended");
        jobs.send(Job { scene_name: scene_name.to_owned(), picture })
            .expect("a thread that lives as long as the saver");
    }

    /// Returns the results since the last call.
    pub fn results(&mut self) -> Vec<Saved> {
        let results: Vec<_> = self.results.try_iter().collect();
        self.n_open -= results.len();
        results
    }

    /// Returns whether the results of some pictures are still to come.
    pub fn is_busy(&self) -> bool {
        self.n_open > 0
    }

    /// Waits until all pictures have been written. No more are taken.
    pub fn finish(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            thread.join().expect("no panic while a picture is written");
        }
    }
}

impl Drop for Saver {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn write_to_next_free(job: &Job) -> Saved {
    let path = next_free(Path::new(""), &job.scene_name);
    output::write_picture(&path, &job.picture)?;
    Ok(path)
}

/// Returns the first path `NAME-001.png`, `NAME-002.png` and so on in a folder that does not exist.
fn next_free(folder: &Path, scene_name: &str) -> PathBuf {
    let stem = output::stem_of(scene_name);
    let mut names = (1..).map(|n| folder.join(format!("{stem}-{n:03}.png")));
    names.find(|path| !path.exists()).expect("numbers do not end")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> Picture {
        Picture { width: 1, height: 1, radiance: Vec::new(), display: vec![[1, 2, 3, 255]] }
    }

    #[test]
    fn nobody_waits_for_a_picture_until_the_end() {
        let (go, may_go) = channel::<()>();
        let (awake, wakes) = channel::<()>();
        let directory = tempfile::TempDir::new().unwrap();
        let folder = directory.path().to_owned();
        let write = move |job: &Job| {
            may_go.recv().unwrap();
            let path = next_free(&folder, &job.scene_name);
            output::write_picture(&path, &job.picture)?;
            Ok(path)
        };
        let mut saver = Saver::with(write, move || awake.send(()).unwrap());
        saver.save("a", picture());
        saver.save("a", picture());
        assert!(saver.results().is_empty() && saver.is_busy(), "the disk is slow");
        go.send(()).unwrap();
        wakes.recv().unwrap();
        let first = saver.results().remove(0).unwrap();
        go.send(()).unwrap();
        saver.finish();
        let second = saver.results().remove(0).unwrap();
        assert_eq!([&first, &second], [&directory.path().join("a-001.png"), &directory.path().join("a-002.png")]);
        assert!(first.exists() && second.exists() && !saver.is_busy());
    }
}
