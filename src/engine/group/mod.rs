//! Draws one picture on several devices: each has the whole scene, and draws tiles of full rows that are handed out by
//! the devices' measured speeds. On devices of one kind, the picture has the same bits as on one of them.

mod handout;

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc},
    thread,
    time::Instant,
};

use self::handout::Handout;
use crate::{
    frame::{Crop, Drawn, Goal, Picture, RenderOptions, Watcher},
    gpu::{Context, GpuError},
    layout::Feature,
    render::BandedRenderer,
    scene::Camera,
    world::World,
};

/// Number of pixels of the smallest tile on a GPU. Fewer pixels leave parts of a large GPU idle.
const LEAST_PIXELS: u32 = 1 << 16;
/// The same on a software driver.
const LEAST_SOFTWARE_PIXELS: u32 = 1 << 8;
/// Number of rows of a border that is wide: to draw it around many tiles would take long.
const WIDE_BORDER: u32 = 8;

/// Renderers of one world on several devices.
pub struct RendererGroup {
    members: Vec<Member>,
    options: RenderOptions,
    handout: Handout,
    /// The picture that was drawn last.
    picture: Picture,
}

struct Member {
    /// Its place in the caller's list, and its name, for messages.
    ix: usize,
    name: String,
    renderer: BandedRenderer,
}

/// A tile of the picture that has been drawn.
struct Tile {
    crop: Crop,
    picture: Picture,
    drawn: Drawn,
}

impl RendererGroup {
    /// Uploads the scene to all devices and creates the pipelines, on all devices at the same time.
    ///
    /// # Errors
    /// Fails as [`BandedRenderer::new`] does on any device.
    pub fn new(contexts: &[Arc<Context>], world: &World, options: &RenderOptions) -> Result<Self, GpuError> {
        let asked = options.crop_or_whole();
        let least_pixels = if contexts[0].is_software() { LEAST_SOFTWARE_PIXELS } else { LEAST_PIXELS };
        let has_wide_borders = options.border() >= WIDE_BORDER;
        let handout = Handout::new(contexts.len(), least_pixels.div_ceil(asked.width()), has_wide_borders);
        // A first tile that is larger gets larger buffers.
        let n_rows = asked.height().div_ceil(contexts.len() as u32);
        let first = RenderOptions { crop: Some(Crop { y1: asked.y0 + n_rows, ..asked }), ..options.clone() };
        let open = |context: &Arc<Context>| BandedRenderer::new(Arc::clone(context), world, &first);
        let renderers: Vec<_> = thread::scope(|scope| {
            let threads: Vec<_> = contexts.iter().map(|context| scope.spawn(|| open(context))).collect();
            threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
        });
        let members = (contexts.iter().zip(renderers).enumerate())
            .map(|(ix, (context, renderer))| Ok(Member { ix, name: context.info().name.clone(), renderer: renderer? }))
            .collect::<Result<_, GpuError>>()?;
        let picture = Picture { width: 0, height: 0, radiance: Vec::new(), display: Vec::new() };
        Ok(Self { members, options: options.clone(), handout, picture })
    }

    /// Sets the camera of the next pictures.
    pub fn set_camera(&mut self, camera: &Camera) {
        self.members.iter_mut().for_each(|member| member.renderer.set_camera(camera));
    }

    /// Sets the index of the next picture's first sample, as [`BandedRenderer::set_first_sample`] does.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn set_first_sample(&mut self, first_sample: u32) -> Result<(), GpuError> {
        self.members.iter_mut().try_for_each(|member| member.renderer.set_first_sample(first_sample))
    }

    /// Draws a new picture. The watcher is told of the samples of the whole picture. If a device fails, the others draw
    /// its rows and it draws no more; a warning says so. Times of passes are sums over all devices, and the time of the
    /// frame is what the clock shows.
    ///
    /// # Errors
    /// All devices have failed, or the goal is a time.
    pub fn draw(&mut self, goal: Goal, watcher: &mut impl Watcher) -> Result<Drawn, GpuError> {
        let Goal::Samples(n_samples) = goal else {
            let device = "several devices".to_owned();
            return Err(GpuError::Lacks { device, missing: "pictures that end by time".to_owned() });
        };
        let asked = self.options.crop_or_whole();
        let begin = Instant::now();
        self.handout.begin(asked.y0..asked.y1);
        let job = Job { handout: Mutex::new(&mut self.handout), freed: Mutex::default(), crop: asked, goal };
        let (send, receive) = mpsc::channel();
        let mut tiles = Vec::new();
        let mut failed = Vec::new();
        thread::scope(|scope| {
            for member in &mut self.members {
                let (job, send) = (&job, send.clone());
                scope.spawn(move || job.work(member, &send));
            }
            drop(send);
            let mut progress = WholeSamples { n_rows: asked.height(), n_samples, n_done: 0 };
            for message in receive {
                match message {
                    Message::Sample(n_rows) => progress.add(n_rows, watcher),
                    Message::Tile(tile) => tiles.push(*tile),
                    Message::Failed(ix, error) => failed.push((ix, error)),
                }
            }
        });
        self.join(tiles, failed, begin)
    }

    /// Joins the tiles to the picture.
    fn join(
        &mut self,
        mut tiles: Vec<Tile>,
        mut failed: Vec<(usize, GpuError)>,
        begin: Instant,
    ) -> Result<Drawn, GpuError> {
        let asked = self.options.crop_or_whole();
        let is_complete = tiles.iter().map(|tile| tile.crop.height()).sum::<u32>() == asked.height();
        if !is_complete {
            return Err(failed.pop().expect("rows are missing only if a device fails").1);
        }
        for (ix, error) in failed {
            let name = self.members.iter().find(|member| member.ix == ix).map_or("", |member| &member.name);
            tracing::warn!("device {ix} of the list, {name}, has failed, and the others draw its rows: {error}");
            self.members.retain(|member| member.ix != ix);
        }
        tiles.sort_by_key(|tile| tile.crop.y0);
        let n_pixels = asked.width() as usize * asked.height() as usize;
        let mut picture =
            Picture { width: asked.width(), height: asked.height(), radiance: Vec::new(), display: Vec::new() };
        picture.radiance.reserve_exact(n_pixels);
        picture.display.reserve_exact(n_pixels);
        let (mut all, mut features) = (None::<Drawn>, Vec::<Feature>::new());
        for Tile { picture: part, mut drawn, .. } in tiles {
            picture.radiance.extend(part.radiance);
            picture.display.extend(part.display);
            features.append(&mut drawn.features);
            match &mut all {
                None => all = Some(drawn),
                Some(all) => all.profile.append(drawn.profile),
            }
        }
        self.picture = picture;
        let mut all = all.expect("a picture has rows");
        all.features = features;
        all.profile.device = self.device_names();
        if let Some(ms) = &mut all.profile.frame_ms {
            *ms = begin.elapsed().as_secs_f64() * 1e3;
        }
        Ok(all)
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

/// What a thread tells of its device.
enum Message {
    /// A sample of a tile of this number of rows has been drawn.
    Sample(u32),
    Tile(Box<Tile>),
    /// The member has failed.
    Failed(usize, GpuError),
}

/// A picture that all members draw.
struct Job<'a> {
    handout: Mutex<&'a mut Handout>,
    /// Tiles of devices that have failed.
    freed: Mutex<Vec<Crop>>,
    crop: Crop,
    goal: Goal,
}

impl Job<'_> {
    /// Draws tiles on a device until none are left.
    fn work(&self, member: &mut Member, send: &mpsc::Sender<Message>) {
        // The receiver lives as long as all threads.
        let tell = |message| send.send(message).expect("a receiver");
        while let Some(crop) = self.next(member.ix) {
            let begin = Instant::now();
            match self.draw(&mut member.renderer, crop, || tell(Message::Sample(crop.height()))) {
                Ok(tile) => {
                    lock(&self.handout).note(member.ix, &(crop.y0..crop.y1), begin.elapsed());
                    tell(Message::Tile(Box::new(tile)));
                }
                Err(error) => {
                    lock(&self.handout).lose(member.ix);
                    lock(&self.freed).push(crop);
                    return tell(Message::Failed(member.ix, error));
                }
            }
        }
    }

    /// Returns the next tile of a device.
    fn next(&self, member_ix: usize) -> Option<Crop> {
        if let Some(crop) = lock(&self.freed).pop() {
            return Some(crop);
        }
        let rows = lock(&self.handout).take(member_ix)?;
        Some(Crop { y0: rows.start, y1: rows.end, ..self.crop })
    }

    fn draw(&self, renderer: &mut BandedRenderer, crop: Crop, sample: impl FnMut()) -> Result<Tile, GpuError> {
        renderer.set_crop(crop)?;
        let mut sample = sample;
        let drawn = renderer.draw(self.goal, &mut sample)?;
        Ok(Tile { crop, picture: renderer.picture()?.into_owned(), drawn })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Turns the samples of tiles into samples of the whole picture.
struct WholeSamples {
    /// Height of the picture.
    n_rows: u32,
    /// Number of samples of each pixel.
    n_samples: u32,
    /// Number of rows that have been drawn, each sample counted.
    n_done: u64,
}

impl WholeSamples {
    fn add(&mut self, n_rows: u32, watcher: &mut impl Watcher) {
        let whole = |n_done: u64| n_done / u64::from(self.n_rows);
        let before = whole(self.n_done);
        self.n_done = (self.n_done + u64::from(n_rows)).min(u64::from(self.n_rows) * u64::from(self.n_samples));
        (before..whole(self.n_done)).for_each(|_| watcher.sample());
        watcher.part((self.n_done % u64::from(self.n_rows)) as f32 / self.n_rows as f32);
    }
}
