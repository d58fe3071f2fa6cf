//! The plan of a frame: the order of its passes and every barrier between them. GPU and CPU follow it.
//!
//! A pass sequence lists passes and barriers in the order of execution. The renderer records a sequence once for each
//! time that it runs, in one or two command buffers.

use super::{
    pass::Pass,
    resource::{
        Resource,
        Resource::{
            Bounces, ChildFlags, Counters, FirstChildren, Hits, LightVisibility, LivePaths, PathSnapshots, PathStates,
            PixelAccumulated, PixelAovs, PixelAux, PixelFiltered, PixelNearest, PixelRadiance, RasterGroups,
            RayRadiance, Rays, ScanBlocks, ShadowRays,
        },
    },
    {Denoise, Integrator, Primary, RenderOptions},
};
use crate::layout::{Frame, LIGHT_LAYERS, N_ATROUS_ITERATIONS};

/// How the passes before or after a barrier access its resources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Kernels read them.
    Read,
    /// Kernels write them.
    Write,
    /// Kernels read or write them.
    Update,
    /// The device reads the size of an indirect dispatch from them.
    Indirect,
}

/// An entry of a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanEntry {
    /// A pass runs.
    Run(Pass),
    /// The accesses of later passes to the resources wait for those of earlier passes.
    Barrier {
        /// The accesses of earlier passes.
        before: Access,
        /// The accesses of later passes.
        after: Access,
        /// The resources for which the plan needs the barrier. The Vulkan barrier itself is not limited to them: it
        /// orders accesses of these types to all memory.
        of: &'static [Resource],
    },
}

/// Passes and barriers in the order of execution.
pub type PassSequence = Vec<PlanEntry>;

/// The properties of a frame that decide which passes it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameProperties {
    /// How light is computed.
    pub integrator: Integrator,
    /// How primary rays find their triangles. Those of paths are always traced.
    pub primary: Primary,
    /// Number of bounces, the primary rays included. The last one of paths only meets light.
    pub n_bounces: u32,
    /// Whether the AOVs of each pixel are written: what its primary ray hits, and what all its rays cost.
    pub pixel_aovs: bool,
    /// Whether the picture has layers of light. Only frames that trace paths have them.
    pub light_layers: bool,
    /// Whether the picture has layers of what camera rays hit: albedo and normal.
    pub surface_layers: bool,
    /// Whether hits are lit. They are not if the frame displays an AOV, such as depth, that depends on the hits of
    /// primary rays only.
    pub is_lit: bool,
    /// Whether the scene has lights that cast shadows.
    pub has_lights: bool,
    /// Whether the frame's sample is added to earlier ones.
    pub adds_samples: bool,
    /// The noise filter.
    pub denoise: Denoise,
    /// Whether an AOV is displayed in place of the picture.
    pub shows_aovs: bool,
}

impl FrameProperties {
    /// Returns the properties of the frame with the most passes that frames of these options can have: the frame is
    /// lit, and its sample is added to earlier ones. It displays the picture. To display an AOV takes no more passes.
    pub fn new(options: &RenderOptions, constants: &Frame) -> Self {
        Self {
            integrator: options.integrator,
            primary: options.primary,
            n_bounces: constants.max_depth,
            pixel_aovs: options.pixel_aovs,
            light_layers: options.has_light_layers(),
            surface_layers: options.surface_layers,
            is_lit: true,
            has_lights: constants.n_lights > 0,
            adds_samples: true,
            denoise: options.noise_filter(),
            shows_aovs: false,
        }
    }
}

/// The passes of a frame in the order of execution: the paper's Algorithm 1.
///
/// A batch is a part of the picture's pixels, with their primary rays and all rays that descend from these. Bounce 0
/// is the primary rays, and each further bounce is the reflected and refracted rays from the hits of the bounce
/// before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Finds the triangles that the pixels show, once a frame.
    pub visibility: PassSequence,
    /// Finds the closest hits of a bounce and makes the next bounce's rays. One sequence a bounce, run for each batch.
    pub bounces: Vec<PassSequence>,
    /// Lights the hits of all bounces and adds up the light in the pixels, once a batch.
    pub light: PassSequence,
    /// Turns the samples into the displayed picture, once a frame.
    pub image: PassSequence,
}

impl Plan {
    /// Returns the passes of a frame with these properties.
    pub fn new(frame: &FrameProperties) -> Self {
        match frame.integrator {
            Integrator::Whitted => Self::of_ray_trees(frame),
            Integrator::Path => Self::of_paths(frame),
        }
    }

    /// Returns the passes of a frame that traces paths.
    fn of_paths(frame: &FrameProperties) -> Self {
        let mut light = if frame.light_layers { layer() } else { PassSequence::new() };
        light.extend(run(Pass::PathResolve, Access::Update, &[PixelRadiance]));
        let sums = run(Pass::PathAccumulate, Access::Read, &[PixelAccumulated, PixelRadiance]);
        Self {
            visibility: PassSequence::new(),
            bounces: (0..frame.n_bounces).map(|depth| bounce_of_paths(frame, depth)).collect(),
            light: if frame.is_lit { light } else { PassSequence::new() },
            image: [if frame.is_lit { sums } else { PassSequence::new() }, display(frame)].concat(),
        }
    }

    /// Returns the passes of a frame that traces the paper's trees of reflected and refracted rays.
    fn of_ray_trees(frame: &FrameProperties) -> Self {
        Self {
            visibility: visibility(frame.primary),
            bounces: (0..frame.n_bounces).map(|depth| bounce(frame, depth)).collect(),
            light: if frame.is_lit { light(frame.has_lights) } else { PassSequence::new() },
            image: [samples(frame), display(frame)].concat(),
        }
    }

    /// Returns the number of passes that a frame of `n_batches` batches runs.
    pub fn n_passes(&self, n_batches: usize) -> usize {
        let in_batch: usize = self.bounces.iter().map(|bounce| passes(bounce).count()).sum();
        let in_frame = passes(&self.visibility).count() + passes(&self.image).count();
        in_frame + n_batches * (in_batch + passes(&self.light).count())
    }
}

/// Returns the passes of a sequence, without its barriers.
pub fn passes(sequence: &[PlanEntry]) -> impl Iterator<Item = Pass> {
    sequence.iter().filter_map(|entry| match entry {
        PlanEntry::Run(pass) => Some(*pass),
        PlanEntry::Barrier { .. } => None,
    })
}

/// Returns the sequence that rasterizes the triangle of each pixel. It is empty if primary rays are traced.
pub fn visibility(primary: Primary) -> PassSequence {
    match primary {
        Primary::Trace => PassSequence::new(),
        // The pass itself makes triangle_ids visible to kernels.
        Primary::Raster => vec![PlanEntry::Run(Pass::Visibility)],
        Primary::SoftwareRaster => vec![
            PlanEntry::Run(Pass::RasterizeTriangles),
            barrier(Access::Write, Access::Update, &[PixelNearest, RasterGroups]),
            barrier(Access::Write, Access::Indirect, &[RasterGroups]),
            PlanEntry::Run(Pass::RasterizeBlocks),
            barrier(Access::Write, Access::Read, &[PixelNearest]),
        ],
    }
}

/// Returns the sequence of one bounce of paths: closest hits, then the light that the paths meet and the way on.
fn bounce_of_paths(frame: &FrameProperties, depth: u32) -> PassSequence {
    let mut bounce = PassSequence::new();
    if depth == 0 {
        bounce.extend(run(Pass::PathBegin, Access::Update, &[Rays, PathStates, ShadowRays, LivePaths]));
    }
    bounce.extend(run(Pass::PathTrace, Access::Update, &[Hits, PathStates, ShadowRays, Counters, PixelAovs]));
    bounce.extend(first_hits(frame, depth));
    if frame.is_lit {
        bounce.extend(run(Pass::PathScatter, Access::Update, &[Rays, PathStates, ShadowRays, ChildFlags, ScanBlocks]));
    }
    if depth == 0 && frame.is_lit && frame.denoise == Denoise::Edge {
        bounce.extend(run(Pass::Auxiliary, Access::Update, &[PixelAux]));
    }
    // The last layer is complete after the last bounce.
    if depth + 1 < LIGHT_LAYERS && frame.is_lit && frame.light_layers {
        bounce.extend(layer());
    }
    if depth + 1 < frame.n_bounces {
        bounce.extend([
            barrier(Access::Indirect, Access::Write, &[Bounces]),
            PlanEntry::Run(Pass::CompactSpine),
            barrier(Access::Write, Access::Read, &[ScanBlocks, Bounces]),
            barrier(Access::Write, Access::Indirect, &[Bounces]),
            PlanEntry::Run(Pass::PathCompact),
            barrier(Access::Write, Access::Update, &[LivePaths]),
        ]);
    }
    bounce
}

/// Returns the entries that note what the camera rays have hit: AOVs, and the layers of surfaces.
fn first_hits(frame: &FrameProperties, depth: u32) -> PassSequence {
    let mut first_hits = PassSequence::new();
    if depth == 0 && frame.pixel_aovs {
        first_hits.extend(run(Pass::PixelAovs, Access::Update, &[PixelAovs]));
    }
    if depth == 0 && frame.is_lit && frame.surface_layers {
        first_hits.extend(run(Pass::SurfaceLayers, Access::Update, &[PixelRadiance]));
    }
    first_hits
}

/// Returns the entries that add up a layer of light.
fn layer() -> PassSequence {
    run(Pass::PathLayers, Access::Update, &[PathSnapshots, PixelRadiance])
}

/// Returns the sequence that finds the closest hits of one bounce's rays and, from these, makes the next bounce's
/// rays.
fn bounce(frame: &FrameProperties, depth: u32) -> PassSequence {
    let mut bounce = closest_hits(frame, depth);
    bounce.extend(first_hits(frame, depth));
    if depth + 1 < frame.n_bounces {
        bounce.extend(next_rays());
    }
    bounce
}

/// Returns the entries that find the closest hits of one bounce's rays. If the frame rasterizes triangles, primary rays
/// are intersected with these. All other rays are traced through the acceleration structure.
fn closest_hits(frame: &FrameProperties, depth: u32) -> PassSequence {
    let is_rasterized = depth == 0 && frame.primary != Primary::Trace;
    run(if is_rasterized { Pass::PrimaryHit } else { Pass::Trace }, Access::Update, &[Hits, Counters, PixelAovs])
}

/// Returns the entries of compaction (the paper's section 2.1), which writes the rays that go on from the hits to the
/// ray queue, without gaps, by a prefix sum.
pub fn next_rays() -> PassSequence {
    vec![
        PlanEntry::Run(Pass::CompactReduce),
        barrier(Access::Write, Access::Update, &[ChildFlags, ScanBlocks]),
        barrier(Access::Indirect, Access::Write, &[Bounces]),
        PlanEntry::Run(Pass::CompactSpine),
        barrier(Access::Write, Access::Read, &[ScanBlocks, Bounces]),
        barrier(Access::Write, Access::Indirect, &[Bounces]),
        PlanEntry::Run(Pass::CompactScatter),
        barrier(Access::Write, Access::Update, &[Rays, FirstChildren]),
    ]
}

/// Returns the sequence that lights the hits of all bounces, and adds up the light in the pixels. A dispatch lasts as
/// long as its longest ray: one dispatch for the shadow rays of all bounces waits for such a ray once, not once a
/// bounce.
fn light(has_lights: bool) -> PassSequence {
    let mut light = PassSequence::new();
    if has_lights {
        light.extend(run(Pass::Shadow, Access::Update, &[LightVisibility, PixelAovs]));
    }
    light.extend([
        PlanEntry::Run(Pass::Shade),
        barrier(Access::Write, Access::Update, &[RayRadiance, Counters]),
        PlanEntry::Run(Pass::Resolve),
        // The next batch overwrites the ray queue. This barrier makes it wait until the passes of this batch have
        // read the queue.
        barrier(Access::Write, Access::Update, &[PixelRadiance]),
    ]);
    light
}

/// Returns the entries that turn the frame's sample into the mean of all samples. There are none for a picture's first
/// sample and for a frame that is not lit.
fn samples(frame: &FrameProperties) -> PassSequence {
    if !frame.is_lit || !frame.adds_samples {
        return PassSequence::new();
    }
    run(Pass::Accumulate, Access::Read, &[PixelAccumulated, PixelRadiance])
}

/// Returns the entries that turn the mean of all samples into the displayed picture, or display an AOV in its place.
pub fn display(frame: &FrameProperties) -> PassSequence {
    let mut display = PassSequence::new();
    if frame.is_lit {
        display.extend(noise_filter(frame.denoise));
    }
    display.push(PlanEntry::Run(if frame.shows_aovs { Pass::FalseColor } else { Pass::Tonemap }));
    display
}

/// Returns the entries of a noise filter.
fn noise_filter(denoise: Denoise) -> PassSequence {
    match denoise {
        Denoise::Off => PassSequence::new(),
        Denoise::Paper { .. } => run(Pass::Denoise, Access::Read, &[PixelFiltered]),
        Denoise::Edge => {
            let entries = std::iter::repeat_n(Pass::AtrousFilter, N_ATROUS_ITERATIONS as usize);
            let passes = std::iter::once(Pass::Demodulate).chain(entries);
            passes.flat_map(|pass| run(pass, Access::Update, &[PixelFiltered])).collect()
        }
    }
}

/// Returns the entries that run a pass, and let what it has written to `of` be accessed `after` it.
fn run(pass: Pass, after: Access, of: &'static [Resource]) -> PassSequence {
    vec![PlanEntry::Run(pass), barrier(Access::Write, after, of)]
}

fn barrier(before: Access, after: Access, of: &'static [Resource]) -> PlanEntry {
    PlanEntry::Barrier { before, after, of }
}
