//! The frame: the order of passes, and every barrier between them. GPU and CPU follow it; the GPU records one command
//! buffer a section.

use super::{
    pass::Pass,
    resource::{
        Resource,
        Resource::{
            Bounces, ChildKinds, Counters, FirstChildren, Hits, LargeTriangles, LightVisibility, PixelAccumulated,
            PixelFeatures, PixelFiltered, PixelNearest, PixelRadiance, RasterGroups, RayRadiance, Rays, ScanBlocks,
        },
    },
    {Denoise, Primary, RenderOptions},
};

/// How passes touch what a barrier orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touch {
    /// Kernels read it.
    Read,
    /// Kernels write it.
    Write,
    /// Kernels read or write it.
    Update,
    /// The device reads the size of a dispatch from it.
    Indirect,
}

/// An entry of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A pass runs.
    Run(Pass),
    /// What later passes do with the resources waits for what earlier passes do with them.
    Barrier {
        /// What earlier passes do.
        before: Touch,
        /// What later passes do.
        after: Touch,
        /// What the barrier is for. Vulkan's barrier orders all memory that is touched so.
        of: &'static [Resource],
    },
}

/// Passes and barriers in their order.
pub type Section = Vec<Step>;

/// Which passes a frame has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameKind {
    /// How primary rays find their triangles.
    pub primary: Primary,
    /// Levels of rays, the primary one counted.
    pub n_bounces: u32,
    /// Whether what each pixel shows is noted.
    pub features: bool,
    /// Whether hits are lit; they are not where only the hits of primary rays are asked for.
    pub is_lit: bool,
    /// Whether the scene has lights that cast shadows.
    pub has_lights: bool,
    /// Whether the frame's sample is added to earlier ones.
    pub adds_samples: bool,
    /// Whether the noise filter runs.
    pub denoises: bool,
    /// Whether a feature is displayed in place of the picture.
    pub shows_feature: bool,
}

impl FrameKind {
    /// A lit frame of several samples by the options, which has all the passes that they can ask for.
    pub fn new(options: &RenderOptions, n_lights: u32) -> Self {
        Self {
            primary: options.primary,
            n_bounces: options.max_depth,
            features: options.features,
            is_lit: true,
            has_lights: n_lights > 0,
            adds_samples: true,
            denoises: options.denoise != Denoise::Off,
            shows_feature: false,
        }
    }
}

/// Algorithm 1: the passes of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Finds the triangles of the whole picture, once a frame.
    pub visibility: Section,
    /// For each bounce of a batch: finds the closest hits, and makes the next bounce's rays.
    pub bounces: Vec<Section>,
    /// For each batch: lights the hits of all its bounces, and adds the light to their pixels.
    pub light: Section,
    /// Turns samples into what a display shows, once a frame.
    pub image: Section,
}

impl Plan {
    /// The passes of such a frame.
    pub fn new(kind: &FrameKind) -> Self {
        Self {
            visibility: visibility(kind.primary),
            bounces: (0..kind.n_bounces).map(|depth| bounce(kind, depth)).collect(),
            light: if kind.is_lit { light(kind.has_lights) } else { Section::new() },
            image: [samples(kind), display(kind)].concat(),
        }
    }

    /// The number of passes that run in so many batches.
    pub fn n_passes(&self, n_batches: usize) -> usize {
        let in_batch: usize = self.bounces.iter().map(|bounce| passes(bounce).count()).sum();
        let in_frame = passes(&self.visibility).count() + passes(&self.image).count();
        in_frame + n_batches * (in_batch + passes(&self.light).count())
    }
}

/// The passes of a section.
pub fn passes(section: &[Step]) -> impl Iterator<Item = Pass> {
    section.iter().filter_map(|step| match step {
        Step::Run(pass) => Some(*pass),
        Step::Barrier { .. } => None,
    })
}

/// The triangles that the pixels show. Where primary rays are traced, nothing has to be known before.
pub fn visibility(primary: Primary) -> Section {
    match primary {
        Primary::Trace => Section::new(),
        Primary::Raster => vec![Step::Run(Pass::Visibility)], // which leaves triangle_ids ready for kernels
        Primary::Compute => vec![
            Step::Run(Pass::RasterizeTriangles),
            barrier(Touch::Write, Touch::Update, &[PixelNearest, LargeTriangles, RasterGroups]),
            barrier(Touch::Write, Touch::Indirect, &[RasterGroups]),
            Step::Run(Pass::RasterizeBlocks),
            barrier(Touch::Write, Touch::Read, &[PixelNearest]),
        ],
    }
}

/// The closest hits of one level of rays, and from them, the next level of rays.
fn bounce(kind: &FrameKind, depth: u32) -> Section {
    let mut bounce = closest_hits(kind, depth);
    if depth == 0 && kind.features {
        bounce.extend([Step::Run(Pass::Features), barrier(Touch::Write, Touch::Update, &[PixelFeatures])]);
    }
    if depth + 1 < kind.n_bounces {
        bounce.extend(next_rays());
    }
    bounce
}

/// The hits of primary rays come from what was rasterized, those of all others from the acceleration structure.
fn closest_hits(kind: &FrameKind, depth: u32) -> Section {
    let is_rasterized = depth == 0 && kind.primary != Primary::Trace;
    vec![
        Step::Run(if is_rasterized { Pass::PrimaryHit } else { Pass::Trace }),
        barrier(Touch::Write, Touch::Update, &[Hits, Counters, PixelFeatures]),
    ]
}

/// Compaction (the paper's section 2.1): the rays that go on from the hits, without gaps, by a prefix sum.
pub fn next_rays() -> Section {
    vec![
        Step::Run(Pass::CompactReduce),
        barrier(Touch::Write, Touch::Update, &[ChildKinds, ScanBlocks]),
        barrier(Touch::Indirect, Touch::Write, &[Bounces]),
        Step::Run(Pass::CompactSpine),
        barrier(Touch::Write, Touch::Read, &[ScanBlocks, Bounces]),
        barrier(Touch::Write, Touch::Indirect, &[Bounces]),
        Step::Run(Pass::CompactScatter),
        barrier(Touch::Write, Touch::Update, &[Rays, FirstChildren]),
    ]
}

/// What the lights give to the hits of all bounces, and that to the pixels. A dispatch lasts as long as its longest ray; one
/// for the shadows of all bounces waits for such a ray once, not once a bounce.
fn light(has_lights: bool) -> Section {
    let mut light = Section::new();
    if has_lights {
        light
            .extend([Step::Run(Pass::Shadow), barrier(Touch::Write, Touch::Update, &[LightVisibility, PixelFeatures])]);
    }
    light.extend([
        Step::Run(Pass::Shade),
        barrier(Touch::Write, Touch::Update, &[RayRadiance, Counters]),
        Step::Run(Pass::Resolve),
        // The next batch overwrites the queue, too.
        barrier(Touch::Write, Touch::Update, &[PixelRadiance]),
    ]);
    light
}

/// The mean of all samples.
fn samples(kind: &FrameKind) -> Section {
    if !kind.is_lit || !kind.adds_samples {
        return Section::new();
    }
    vec![Step::Run(Pass::Accumulate), barrier(Touch::Write, Touch::Read, &[PixelAccumulated, PixelRadiance])]
}

/// From the mean of all samples to what a display shows.
pub fn display(kind: &FrameKind) -> Section {
    let mut display = Section::new();
    if kind.is_lit && kind.denoises {
        display.extend([Step::Run(Pass::Denoise), barrier(Touch::Write, Touch::Read, &[PixelFiltered])]);
    }
    display.push(Step::Run(if kind.shows_feature { Pass::FalseColor } else { Pass::Tonemap }));
    display
}

fn barrier(before: Touch, after: Touch, of: &'static [Resource]) -> Step {
    Step::Barrier { before, after, of }
}
