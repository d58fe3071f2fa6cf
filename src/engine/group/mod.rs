//! Draws one picture on several devices, each of which has the whole scene. On devices of one kind, the picture has the
//! same bits as on one of them.
//!
//! ```text
//! handout   ranges of units of work for each device, by its measured speed
//! samples   units are blocks of samples of all pixels, which cost the same everywhere: paths without `edge` or layers
//! rows      units are rows of pixels, of which tiles are made: everything else
//! ```

mod handout;
mod rows;
mod samples;

use std::{
    ops::Range,
    sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc},
    thread,
    time::Instant,
};

use self::handout::{Handout, Portions};
use crate::{
    frame::{Crop, Denoise, Drawn, Goal, Integrator, Picture, RenderOptions, Watcher},
    gpu::{Context, GpuError},
    render::BandedRenderer,
    scene::Camera,
    world::World,
};

/// Renderers of one world on several devices.
pub struct RendererGroup {
    members: Vec<Member>,
    options: RenderOptions,
    /// Whether samples of all pixels can be drawn apart.
    shares_samples: bool,
    /// Index of the next picture's first sample.
    first_sample: u32,
    rows: Handout,
    samples: Handout,
    /// The picture that was drawn last.
    picture: Picture,
}

struct Member {
    /// Its place in the caller's list, and its name, for messages.
    ix: usize,
    name: String,
    renderer: BandedRenderer,
}

impl RendererGroup {
    /// Uploads the scene to all devices and creates the pipelines, on all devices at the same time.
    ///
    /// # Errors
    /// Fails as [`BandedRenderer::new`] does on any device.
    pub fn new(contexts: &[Arc<Context>], world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        let n_devices = contexts.len();
        let asked = options.crop_or_whole();
        let first = match can_share_samples(options) {
            true => options.clone(),
            // A first tile that is larger gets larger buffers.
            false => {
                let y1 = asked.y0 + asked.height().div_ceil(n_devices as u32);
                RenderOptions { crop: Some(Crop { y1, ..asked }), ..options.clone() }
            }
        };
        let open = |context: &Arc<Context>| BandedRenderer::new(Arc::clone(context), world, &first);
        let renderers: Vec<_> = thread::scope(|scope| {
            let threads: Vec<_> = contexts.iter().map(|context| scope.spawn(|| open(context))).collect();
            threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
        });
        // Bands of a picture cannot be replaced by their mean.
        let has_one_band = |renderer: &Result<BandedRenderer, GpuError>| {
            renderer.as_ref().is_ok_and(|renderer| renderer.n_bands() == 1)
        };
        let shares_samples = can_share_samples(options) && renderers.iter().all(has_one_band);
        let members = (contexts.iter().zip(renderers).enumerate())
            .map(|(ix, (context, renderer))| Ok(Member { ix, name: context.info().name.clone(), renderer: renderer? }))
            .collect::<Result<_, GpuError>>()?;
        let are_equal = contexts.iter().all(|context| context.info().name == contexts[0].info().name);
        let of_samples = if are_equal { Portions::OneEach } else { Portions::Many { least: 1 } };
        Ok(Self {
            members,
            options: options.clone(),
            shares_samples,
            first_sample: 0,
            rows: Handout::new(n_devices, rows::portions(contexts, options)),
            samples: Handout::new(n_devices, of_samples),
            picture: Picture::default(),
        })
    }

    /// Sets the camera of the next pictures.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.members.iter_mut().for_each(|member| member.renderer.set_camera(camera));
    }

    /// Sets the index of the next picture's first sample, as [`BandedRenderer::set_first_sample`] does.
    pub fn set_first_sample(&mut self, first_sample: u32) {
        self.first_sample = first_sample;
    }

    /// Draws a new picture. The watcher is told of the samples of the whole picture. If a device fails, the others do
    /// its work and it draws no more; a warning says so. Times of passes are sums over all devices, and the time of the
    /// frame is what the clock shows.
    ///
    /// # Errors
    /// All devices have failed, or the goal is a time. The last one that has failed is asked again next time.
    pub fn draw(&mut self, goal: Goal, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        let Goal::Samples(n_samples) = goal else {
            let device = "several devices".to_owned();
            return Err(GpuError::Lacks { device, missing: "pictures that end by time".to_owned() });
        };
        let begin = Instant::now();
        let by_samples = self.shares_samples && n_samples >= 2 * samples::UNIT;
        let mut drawn = match by_samples {
            true => self.draw_samples(n_samples, watcher)?,
            false => self.draw_rows(n_samples, watcher)?,
        };
        drawn.profile.device = self.device_names();
        if let Some(ms) = &mut drawn.profile.frame_ms {
            *ms = begin.elapsed().as_secs_f64() * 1e3;
        }
        Ok(drawn)
    }

    /// Returns the names of the devices, those of several equal devices with their number.
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

    /// Returns the picture that was drawn last.
    pub fn picture(&self) -> &Picture {
        &self.picture
    }
}

/// Whether samples of all pixels can be drawn apart. The noise filter `edge` and layers need all samples of a pixel on
/// one device.
fn can_share_samples(options: &RenderOptions) -> bool {
    let has_layers = options.features || options.has_light_layers();
    options.integrator == Integrator::Path && !has_layers && options.noise_filter() != Denoise::Edge
}

/// Work that all members share.
struct Job<'a, W> {
    handout: Mutex<&'a mut Handout>,
    /// Ranges of devices that have failed.
    freed: Mutex<Vec<Range<u32>>>,
    work: W,
}

/// What a thread tells of its device.
enum Message<T> {
    /// Samples of this many pixels, as a share of all pixels, have been drawn.
    Samples(f64),
    Done(Range<u32>, T),
    /// The member has failed.
    Failed(usize, GpuError),
}

/// Lets all members work until no units are left. `work` does a range of units and calls its last argument with the
/// share of the picture of which a sample has been drawn. Returns the results in the order of their ranges.
///
/// # Errors
/// All members have failed.
fn share<T: Send>(
    members: &mut Vec<Member>,
    handout: &mut Handout,
    units: Range<u32>,
    watcher: &mut impl Watcher,
    work: impl Fn(&mut BandedRenderer, Range<u32>, &dyn Fn(f64)) -> Result<T, GpuError> + Sync,
) -> Result<Vec<(Range<u32>, T)>, GpuError> {
    let n_units = units.len();
    handout.begin(units);
    let job = Job { handout: Mutex::new(handout), freed: Mutex::default(), work };
    let (mut results, mut progress) = (Vec::new(), WholeSamples { n_done: 0.0 });
    // A device may fail when the others have nothing left to do, and then they begin again.
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
                    Message::Samples(share) => progress.add(share, watcher),
                    Message::Done(range, result) => results.push((range, result)),
                    Message::Failed(ix, error) => failed.push((ix, error)),
                }
            }
        });
        for (ix, error) in failed {
            if let [only] = &members[..]
                && only.ix == ix
            {
                return Err(error);
            }
            let name = members.iter().find(|member| member.ix == ix).map_or("", |member| &member.name);
            tracing::warn!("device {ix} of the list, {name}, has failed, and the others do its work: {error}");
            members.retain(|member| member.ix != ix);
        }
    }
    results.sort_by_key(|(range, _)| range.start);
    Ok(results)
}

impl<W> Job<'_, W> {
    /// Does the work of a device until no units are left.
    fn run<T>(&self, member: &mut Member, send: &mpsc::Sender<Message<T>>)
    where
        W: Fn(&mut BandedRenderer, Range<u32>, &dyn Fn(f64)) -> Result<T, GpuError>,
    {
        // The receiver lives as long as all threads.
        let tell = |message| send.send(message).expect("a receiver");
        while let Some(range) = self.next(member.ix) {
            let begin = Instant::now();
            match (self.work)(&mut member.renderer, range.clone(), &|share| tell(Message::Samples(share))) {
                Ok(result) => {
                    lock(&self.handout).note(member.ix, &range, begin.elapsed());
                    tell(Message::Done(range, result));
                }
                Err(error) => {
                    lock(&self.handout).lose(member.ix);
                    lock(&self.freed).push(range);
                    return tell(Message::Failed(member.ix, error));
                }
            }
        }
    }

    /// Returns the next range of a device.
    fn next(&self, member_ix: usize) -> Option<Range<u32>> {
        let freed = lock(&self.freed).pop();
        freed.or_else(|| lock(&self.handout).take(member_ix))
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Turns samples of parts of the picture into samples of the whole picture.
struct WholeSamples {
    /// Number of samples of all pixels that have been drawn.
    n_done: f64,
}

impl WholeSamples {
    fn add(&mut self, share: f64, watcher: &mut impl Watcher) {
        // The shares of a sample add up to 1, but for rounding.
        let whole = |n_done: f64| (n_done + 1e-6).floor() as u64;
        let before = whole(self.n_done);
        self.n_done += share;
        (before..whole(self.n_done)).for_each(|_| watcher.sample());
        watcher.part((self.n_done - self.n_done.floor()) as f32);
    }
}
