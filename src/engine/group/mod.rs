//! Draws pictures on several devices, each of which has the whole scene. On devices of one kind, the pictures have the
//! same bits as on one of them.
//!
//! ```text
//! work_queue   ranges of units of work for each device, according to its measured speed
//! samples      one picture: a unit is a block of samples of all pixels, which costs the same everywhere; for paths
//!              without `edge` or layers
//! columns      one picture: a unit is a column of pixels, and a range of columns is a strip; for all other pictures
//! film         many pictures: a unit is a picture
//! ```

mod columns;
mod film;
mod noise_tiles;
mod samples;
mod work_queue;

use std::{
    cell::Cell,
    ops::Range,
    sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc},
    thread,
    time::Instant,
};

pub use self::film::FilmRenderer;
use self::work_queue::{Chunking, WorkQueue};
use crate::{
    frame::{Crop, Denoise, Drawn, Goal, Integrator, Picture, RenderOptions, Watcher},
    gpu::{Context, GpuError},
    render::BandedRenderer,
    scene::Camera,
    world::World,
};

/// Renderers of one world on several devices.
pub struct RendererGroup {
    members: Vec<Member<BandedRenderer>>,
    options: RenderOptions,
    /// Whether the devices can share the samples of a picture.
    shares_samples: bool,
    /// Index of the next picture's first sample.
    first_sample: u32,
    columns: WorkQueue,
    samples: WorkQueue,
    noise_tiles: WorkQueue,
    /// The picture that was drawn last.
    picture: Picture,
}

struct Member<R> {
    /// Index of the device in the caller's list.
    ix: usize,
    /// Name of the device.
    name: String,
    renderer: R,
}

impl RendererGroup {
    /// Uploads the scene to all devices and creates the pipelines, on all devices at the same time.
    ///
    /// # Errors
    /// Fails as [`BandedRenderer::new`] does on any device.
    pub fn new(contexts: &[Arc<Context>], world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_devices = contexts.len();
        let may_share_samples = can_share_samples(options);
        let asked = options.crop_or_whole();
        let first = if may_share_samples {
            options.clone()
        } else {
            // Buffers have room for the first device's first strip. Larger strips get new buffers.
            let x1 = asked.x0 + asked.width().div_ceil(n_devices as u32);
            RenderOptions { crop: Some(Crop { x1, ..asked }), ..options.clone() }
        };
        let open = |context: &Arc<Context>| BandedRenderer::new(Arc::clone(context), world, &first);
        let members = open_members(contexts, open)?;
        // `window_mean`, from which samples are shared, needs a picture of one band.
        let shares_samples = may_share_samples && members.iter().all(|member| member.renderer.n_bands() == 1);
        let of_samples = if are_alike(contexts) { Chunking::OneEach } else { Chunking::Guided { least: 1 } };
        Ok(Self {
            members,
            options: options.clone(),
            shares_samples,
            first_sample: 0,
            columns: WorkQueue::new(n_devices, columns::chunking(contexts, options)),
            samples: WorkQueue::new(n_devices, of_samples),
            noise_tiles: WorkQueue::new(n_devices, noise_tiles::chunking(contexts)),
            picture: Picture::default(),
        })
    }

    /// Draws another world from now on. A device that fails draws nothing more, and a warning says so.
    ///
    /// # Errors
    /// All devices have failed. Then nothing has changed.
    pub fn set_world(&mut self, world: &World) -> Result<(), GpuError> {
        let results: Vec<_> = self.members.iter_mut().map(|member| member.renderer.set_world(world)).collect();
        if results.iter().all(Result::is_err) {
            return results.into_iter().collect();
        }
        let mut results = results.into_iter();
        self.members.retain(|member| match results.next().expect("a result for each member") {
            Ok(()) => true,
            Err(error) => {
                tracing::warn!("{} draws nothing more: {error}", member.name);
                false
            }
        });
        Ok(())
    }

    /// Sets the camera of the next pictures.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.members.iter_mut().for_each(|member| member.renderer.set_camera(camera));
    }

    /// Sets the index of the next picture's first sample, as [`BandedRenderer::set_first_sample`] does.
    pub fn set_first_sample(&mut self, first_sample: u32) {
        self.first_sample = first_sample;
    }

    /// Sets the random numbers of the next pictures, as [`BandedRenderer::set_seed`] does.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn set_seed(&mut self, seed: u32) -> Result<(), GpuError> {
        self.members.iter_mut().try_for_each(|member| member.renderer.set_seed(seed))
    }

    /// Draws a new picture. The watcher is told of the samples of the whole picture. If a device fails, a warning says
    /// so, the others do its work, and it draws nothing more. Times of passes are sums over all devices. The time of
    /// the frame is the elapsed time.
    ///
    /// # Errors
    /// All devices have failed, or the goal is a time. The next picture is tried on the device that failed last.
    pub fn draw(&mut self, goal: Goal, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        let Goal::Samples(n_samples) = goal else {
            let device = "several devices".to_owned();
            return Err(GpuError::Lacks { device, missing: "pictures that end by time".to_owned() });
        };
        let begin = Instant::now();
        let by_samples = self.shares_samples && n_samples >= 2 * samples::UNIT;
        let mut drawn = match by_samples {
            true => self.draw_samples(n_samples, watcher)?,
            false => self.draw_columns(n_samples, watcher)?,
        };
        drawn.profile.device = self.device_names();
        if let Some(ms) = &mut drawn.profile.frame_ms {
            *ms = begin.elapsed().as_secs_f64() * 1e3;
        }
        Ok(drawn)
    }

    /// Returns the names of the devices. A name that several devices have is preceded by their number, as in
    /// `2 x name`.
    fn device_names(&self) -> String {
        let mut counted: Vec<(&str, usize)> = Vec::new();
        for Member { name, .. } in &self.members {
            match counted.iter_mut().find(|(other, _)| other == name) {
                Some((_, n)) => *n += 1,
                None => counted.push((name, 1)),
            }
        }
        let phrase = |(name, n): (&str, usize)| if n == 1 { name.to_owned() } else { format!("{n} x {name}") };
        counted.into_iter().map(phrase).collect::<Vec<_>>().join(", ")
    }

    /// Number of devices that have not failed.
    pub fn n_devices(&self) -> usize {
        self.members.len()
    }

    /// Draws rectangles of the picture from now on, after noise tiles.
    ///
    /// # Errors
    /// The picture exceeds a device's memory.
    pub fn leave_noise_tiles(&mut self) -> Result<(), GpuError> {
        let asked = self.options.crop_or_whole();
        self.members.iter_mut().try_for_each(|member| member.renderer.set_crop(asked))
    }

    /// Returns the picture that was drawn last.
    pub fn picture(&self) -> &Picture {
        &self.picture
    }
}

/// Whether all devices are of one kind.
fn are_alike(contexts: &[Arc<Context>]) -> bool {
    contexts.iter().all(|context| context.info().name == contexts[0].info().name)
}

/// Opens a renderer on each device, all at the same time.
fn open_members<R: Send>(
    contexts: &[Arc<Context>],
    open: impl Fn(&Arc<Context>) -> Result<R, GpuError> + Sync,
) -> Result<Vec<Member<R>>, GpuError> {
    let renderers: Vec<_> = thread::scope(|scope| {
        let threads: Vec<_> = contexts.iter().map(|context| scope.spawn(|| open(context))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    let member = |(ix, renderer): (usize, Result<R, GpuError>)| {
        Ok(Member { ix, name: contexts[ix].info().name.clone(), renderer: renderer? })
    };
    renderers.into_iter().enumerate().map(member).collect()
}

/// Whether devices can share the samples of a picture: each draws some samples of all pixels. The noise filter `edge`
/// and layers need all samples of a pixel on one device.
fn can_share_samples(options: &RenderOptions) -> bool {
    let has_layers = options.pixel_aovs || !options.mean_layers().is_empty();
    options.integrator == Integrator::Path && !has_layers && options.noise_filter() != Denoise::Edge
}

/// Work that all members share.
struct Job<'a, W> {
    queue: Mutex<&'a mut WorkQueue>,
    /// Does a range of units.
    work: W,
}

/// What the thread of a member tells the main thread.
enum Message<T> {
    /// One sample has been drawn of some pixels. The value is their share of all pixels.
    Sample(f64),
    /// A range is done, with this result.
    Done(Range<u32>, T),
    /// A member has failed within a range.
    Failed(Failure),
}

struct Failure {
    /// Index of the member.
    ix: usize,
    error: GpuError,
    /// Sum of the shares of the samples that it had drawn of the unfinished range.
    lost: f64,
}

/// Lets all members work until all units are done. `work` does a range of units. Each time that a sample of some pixels
/// has been drawn, it calls its last argument with their share of all pixels. Returns the results in the order of their
/// ranges. Members that fail are removed.
///
/// # Errors
/// All members have failed. The last one that has failed is kept.
fn share<R: Send, T: Send>(
    members: &mut Vec<Member<R>>,
    queue: &mut WorkQueue,
    units: Range<u32>,
    watcher: &mut impl Watcher,
    work: impl Fn(&mut R, Range<u32>, &dyn Fn(f64)) -> Result<T, GpuError> + Sync,
) -> Result<Vec<(Range<u32>, T)>, GpuError> {
    let n_units = units.len();
    queue.begin(units);
    let job = Job { queue: Mutex::new(queue), work };
    let (mut results, mut progress) = (Vec::new(), WholeSamples::default());
    // If a device fails when the threads of the others have ended, a further round does its range.
    while results.iter().map(|(range, _): &(Range<u32>, T)| range.len()).sum::<usize>() < n_units {
        let (send, receive) = mpsc::channel();
        let mut failed = Vec::new();
        thread::scope(|scope| {
            for member in &mut *members {
                let (job, send) = (&job, send.clone());
                scope.spawn(move || job.run(member, &send));
            }
            drop(send);
            for message in receive {
                match message {
                    Message::Sample(share) => progress.add(share, watcher),
                    Message::Done(range, result) => results.push((range, result)),
                    Message::Failed(failure) => {
                        progress.n_done -= failure.lost;
                        failed.push(failure);
                    }
                }
            }
        });
        for Failure { ix, error, .. } in failed {
            remove_failed(members, ix, error)?;
        }
    }
    results.sort_by_key(|(range, _)| range.start);
    Ok(results)
}

/// Removes a member that has failed, and warns of it.
///
/// # Errors
/// Returns the member's error if no other member is left. The member is kept then.
fn remove_failed<R>(members: &mut Vec<Member<R>>, ix: usize, error: GpuError) -> Result<(), GpuError> {
    if members.len() == 1 {
        return Err(error);
    }
    let name = members.iter().find(|member| member.ix == ix).map_or("", |member| &member.name);
    tracing::warn!("device {ix} of the list, {name}, has failed, and the others do its work: {error}");
    members.retain(|member| member.ix != ix);
    Ok(())
}

impl<W> Job<'_, W> {
    /// Does the work of a member until the queue is empty.
    fn run<R, T>(&self, member: &mut Member<R>, send: &mpsc::Sender<Message<T>>)
    where
        W: Fn(&mut R, Range<u32>, &dyn Fn(f64)) -> Result<T, GpuError>,
    {
        // The receiver outlives all threads.
        let tell = |message| send.send(message).expect("a receiver");
        loop {
            let Some(range) = lock(&self.queue).take(member.ix) else { return };
            let (begin, drawn) = (Instant::now(), Cell::new(0.0));
            let tell_sample = |share| {
                drawn.set(drawn.get() + share);
                tell(Message::Sample(share));
            };
            match (self.work)(&mut member.renderer, range.clone(), &tell_sample) {
                Ok(result) => {
                    lock(&self.queue).record_time(member.ix, &range, begin.elapsed());
                    tell(Message::Done(range, result));
                }
                Err(error) => {
                    lock(&self.queue).mark_failed(member.ix, range);
                    return tell(Message::Failed(Failure { ix: member.ix, error, lost: drawn.get() }));
                }
            }
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Counts samples of parts of a picture or film, and tells the watcher of samples of whole pictures.
#[derive(Default)]
struct WholeSamples {
    /// Sum of the shares of all samples that have been drawn. It becomes less if a device fails, since the samples of
    /// its unfinished range are drawn again.
    n_done: f64,
    /// Number of samples of which the watcher knows.
    n_told: u32,
}

impl WholeSamples {
    fn add(&mut self, share: f64, watcher: &mut impl Watcher) {
        self.n_done += share;
        // The shares of a sample add up to 1 but for rounding.
        let n_whole = (self.n_done + 1e-6).floor() as u32;
        (self.n_told..n_whole).for_each(|_| watcher.sample());
        self.n_told = self.n_told.max(n_whole);
        watcher.sample_progress((self.n_done - f64::from(self.n_told)).max(0.0) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_are_drawn_again_are_told_once() {
        let (mut progress, mut n_told) = (WholeSamples::default(), 0);
        let mut add =
            |progress: &mut WholeSamples, n: u32| (0..n).for_each(|_| progress.add(0.25, &mut || n_told += 1));
        add(&mut progress, 10);
        progress.n_done -= 1.5;
        add(&mut progress, 6);
        add(&mut progress, 6);
        assert_eq!((n_told, progress.n_told, progress.n_done), (4, 4, 4.0));
    }
}
