//! The plan of a frame: the order of its passes and every barrier between them. GPU and CPU follow it.
//!
//! A section is a sequence of passes and barriers. The renderer records a section once for each time that it runs, in
//! one or two command buffers.

use super::{
    pass::Pass,
    resource::{
        Resource,
        Resource::{
            Bounces, ChildKinds, Counters, FirstChildren, Hits, LightVisibility, LivePaths, PathSnapshots, PathStates,
            PixelAccumulated, PixelAovs, PixelAux, PixelFiltered, PixelNearest, PixelRadiance, RasterGroups,
            RayRadiance, Rays, ScanBlocks, ShadowRays,
        },
    },
    {Denoise, Integrator, Primary, RenderOptions},
};
use crate::layout::{EDGE_STEPS, Frame, LIGHT_LAYERS};

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

/// An entry of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A pass runs.
    Run(Pass),
    /// The accesses of later passes to the resources wait for those of earlier passes.
    Barrier {
        /// The accesses of earlier passes.
        before: Access,
        /// The accesses of later passes.
        after: Access,
        /// The resources for which the plan needs the barrier. The Vulkan barrier itself is not limited to them: it
        /// orders accesses of these kinds to all memory.
        of: &'static [Resource],
    },
}

/// Passes and barriers in the order of execution.
pub type Section = Vec<Step>;

/// The properties of a frame that decide which passes it has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameKind {
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

impl FrameKind {
    /// Returns the kind of a frame with the most passes that frames of these options can have: the frame is lit, and
    /// its sample is added to earlier ones. It displays the picture. To display an AOV takes no more passes.
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
    pub visibility: Section,
    /// Finds the closest hits of a bounce and makes the next bounce's rays. One section a bounce, run for each batch.
    pub bounces: Vec<Section>,
    /// Lights the hits of all bounces and adds up the light in the pixels, once a batch.
    pub light: Section,
    /// Turns the samples into the displayed picture, once a frame.
    pub image: Section,
}

impl Plan {
    /// Returns the passes of a frame of this kind.
    pub fn new(kind: &FrameKind) -> Self {
        match kind.integrator {
            Integrator::Whitted => Self::of_ray_trees(kind),
            Integrator::Path => Self::of_paths(kind),
        }
    }

    /// Returns the passes of a frame that traces paths.
    fn of_paths(kind: &FrameKind) -> Self {
        let mut light = if kind.light_layers { layer().to_vec() } else { Section::new() };
        light.extend([Step::Run(Pass::PathResolve), barrier(Access::Write, Access::Update, &[PixelRadiance])]);
        let sums = vec![
            Step::Run(Pass::PathAccumulate),
            barrier(Access::Write, Access::Read, &[PixelAccumulated, PixelRadiance]),
        ];
        Self {
            visibility: Section::new(),
            bounces: (0..kind.n_bounces).map(|depth| bounce_of_paths(kind, depth)).collect(),
            light: if kind.is_lit { light } else { Section::new() },
            image: [if kind.is_lit { sums } else { Section::new() }, display(kind)].concat(),
        }
    }

    /// Returns the passes of a frame that traces the paper's trees of reflected and refracted rays.
    fn of_ray_trees(kind: &FrameKind) -> Self {
        Self {
            visibility: visibility(kind.primary),
            bounces: (0..kind.n_bounces).map(|depth| bounce(kind, depth)).collect(),
            light: if kind.is_lit { light(kind.has_lights) } else { Section::new() },
            image: [samples(kind), display(kind)].concat(),
        }
    }

    /// Returns the number of passes that a frame of `n_batches` batches runs.
    pub fn n_passes(&self, n_batches: usize) -> usize {
        let in_batch: usize = self.bounces.iter().map(|bounce| passes(bounce).count()).sum();
        let in_frame = passes(&self.visibility).count() + passes(&self.image).count();
        in_frame + n_batches * (in_batch + passes(&self.light).count())
    }
}

/// Returns the passes of a section, without its barriers.
pub fn passes(section: &[Step]) -> impl Iterator<Item = Pass> {
    section.iter().filter_map(|step| match step {
        Step::Run(pass) => Some(*pass),
        Step::Barrier { .. } => None,
    })
}

/// Returns the section that rasterizes the triangle of each pixel. It is empty if primary rays are traced.
pub fn visibility(primary: Primary) -> Section {
    match primary {
        Primary::Trace => Section::new(),
        Primary::Raster => vec![Step::Run(Pass::Visibility)], // the pass itself makes triangle_ids visible to kernels
        Primary::SoftwareRaster => vec![
            Step::Run(Pass::RasterizeTriangles),
            barrier(Access::Write, Access::Update, &[PixelNearest, RasterGroups]),
            barrier(Access::Write, Access::Indirect, &[RasterGroups]),
            Step::Run(Pass::RasterizeBlocks),
            barrier(Access::Write, Access::Read, &[PixelNearest]),
        ],
    }
}

/// Returns the section of one bounce of paths: closest hits, then the light that the paths meet and the way on.
fn bounce_of_paths(kind: &FrameKind, depth: u32) -> Section {
    let mut bounce = Section::new();
    if depth == 0 {
        bounce.extend([
            Step::Run(Pass::PathBegin),
            barrier(Access::Write, Access::Update, &[Rays, PathStates, ShadowRays, LivePaths]),
        ]);
    }
    bounce.extend([
        Step::Run(Pass::PathTrace),
        barrier(Access::Write, Access::Update, &[Hits, PathStates, ShadowRays, Counters, PixelAovs]),
    ]);
    if depth == 0 && kind.pixel_aovs {
        bounce.extend([Step::Run(Pass::PixelAovs), barrier(Access::Write, Access::Update, &[PixelAovs])]);
    }
    bounce.extend(surface_layers(kind, depth));
    if kind.is_lit {
        bounce.extend([
            Step::Run(Pass::PathScatter),
            barrier(Access::Write, Access::Update, &[Rays, PathStates, ShadowRays, ChildKinds, ScanBlocks]),
        ]);
    }
    if depth == 0 && kind.is_lit && kind.denoise == Denoise::Edge {
        bounce.extend([Step::Run(Pass::Auxiliary), barrier(Access::Write, Access::Update, &[PixelAux])]);
    }
    // The last layer is complete after the last bounce.
    if depth + 1 < LIGHT_LAYERS && kind.is_lit && kind.light_layers {
        bounce.extend(layer());
    }
    if depth + 1 < kind.n_bounces {
        bounce.extend([
            barrier(Access::Indirect, Access::Write, &[Bounces]),
            Step::Run(Pass::CompactSpine),
            barrier(Access::Write, Access::Read, &[ScanBlocks, Bounces]),
            barrier(Access::Write, Access::Indirect, &[Bounces]),
            Step::Run(Pass::PathCompact),
            barrier(Access::Write, Access::Update, &[LivePaths]),
        ]);
    }
    bounce
}

/// Returns the steps that add up what camera rays hit, if the frame has them and `depth` is the bounce of these rays.
fn surface_layers(kind: &FrameKind, depth: u32) -> Section {
    if depth > 0 || !kind.is_lit || !kind.surface_layers {
        return Section::new();
    }
    vec![Step::Run(Pass::SurfaceLayers), barrier(Access::Write, Access::Update, &[PixelRadiance])]
}

/// Returns the steps that add up a layer of light.
fn layer() -> [Step; 2] {
    [Step::Run(Pass::PathLayers), barrier(Access::Write, Access::Update, &[PathSnapshots, PixelRadiance])]
}

/// Returns the section that finds the closest hits of one bounce's rays and, from these, makes the next bounce's
/// rays.
fn bounce(kind: &FrameKind, depth: u32) -> Section {
    let mut bounce = closest_hits(kind, depth);
    if depth == 0 && kind.pixel_aovs {
        bounce.extend([Step::Run(Pass::PixelAovs), barrier(Access::Write, Access::Update, &[PixelAovs])]);
    }
    bounce.extend(surface_layers(kind, depth));
    if depth + 1 < kind.n_bounces {
        bounce.extend(next_rays());
    }
    bounce
}

/// Returns the steps that find the closest hits of one bounce's rays. If the frame rasterizes triangles, primary rays
/// are intersected with these. All other rays are traced through the acceleration structure.
fn closest_hits(kind: &FrameKind, depth: u32) -> Section {
    let is_rasterized = depth == 0 && kind.primary != Primary::Trace;
    vec![
        Step::Run(if is_rasterized { Pass::PrimaryHit } else { Pass::Trace }),
        barrier(Access::Write, Access::Update, &[Hits, Counters, PixelAovs]),
    ]
}

/// Returns the steps of compaction (the paper's section 2.1), which writes the rays that go on from the hits to the
/// ray queue, without gaps, by a prefix sum.
pub fn next_rays() -> Section {
    vec![
        Step::Run(Pass::CompactReduce),
        barrier(Access::Write, Access::Update, &[ChildKinds, ScanBlocks]),
        barrier(Access::Indirect, Access::Write, &[Bounces]),
        Step::Run(Pass::CompactSpine),
        barrier(Access::Write, Access::Read, &[ScanBlocks, Bounces]),
        barrier(Access::Write, Access::Indirect, &[Bounces]),
        Step::Run(Pass::CompactScatter),
        barrier(Access::Write, Access::Update, &[Rays, FirstChildren]),
    ]
}

/// Returns the section that lights the hits of all bounces, and adds up the light in the pixels. A dispatch lasts as
/// long as its longest ray: one dispatch for the shadow rays of all bounces waits for such a ray once, not once a
/// bounce.
fn light(has_lights: bool) -> Section {
    let mut light = Section::new();
    if has_lights {
        light.extend([Step::Run(Pass::Shadow), barrier(Access::Write, Access::Update, &[LightVisibility, PixelAovs])]);
    }
    light.extend([
        Step::Run(Pass::Shade),
        barrier(Access::Write, Access::Update, &[RayRadiance, Counters]),
        Step::Run(Pass::Resolve),
        // The next batch overwrites the ray queue. This barrier makes it wait until the passes of this batch have
        // read the queue.
        barrier(Access::Write, Access::Update, &[PixelRadiance]),
    ]);
    light
}

/// Returns the steps that turn the frame's sample into the mean of all samples. There are none for a picture's first
/// sample and for a frame that is not lit.
fn samples(kind: &FrameKind) -> Section {
    if !kind.is_lit || !kind.adds_samples {
        return Section::new();
    }
    vec![Step::Run(Pass::Accumulate), barrier(Access::Write, Access::Read, &[PixelAccumulated, PixelRadiance])]
}

/// Returns the steps that turn the mean of all samples into the displayed picture, or display an AOV in its place.
pub fn display(kind: &FrameKind) -> Section {
    let mut display = Section::new();
    if kind.is_lit {
        display.extend(noise_filter(kind.denoise));
    }
    display.push(Step::Run(if kind.shows_aovs { Pass::FalseColor } else { Pass::Tonemap }));
    display
}

/// Returns the steps of a noise filter.
fn noise_filter(denoise: Denoise) -> Section {
    match denoise {
        Denoise::Off => Section::new(),
        Denoise::Paper { .. } => vec![Step::Run(Pass::Denoise), barrier(Access::Write, Access::Read, &[PixelFiltered])],
        Denoise::Edge => {
            let steps = std::iter::repeat_n(Pass::AtrousFilter, EDGE_STEPS as usize);
            let passes = std::iter::once(Pass::Demodulate).chain(steps);
            passes
                .flat_map(|pass| [Step::Run(pass), barrier(Access::Write, Access::Update, &[PixelFiltered])])
                .collect()
        }
    }
}

fn barrier(before: Access, after: Access, of: &'static [Resource]) -> Step {
    Step::Barrier { before, after, of }
}
