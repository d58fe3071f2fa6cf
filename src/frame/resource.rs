//! The buffers and images by which the passes of a frame hand data to one another.

use crate::layout;

/// A buffer or image that some pass writes. Kernels have it under the same name in snake case, as `first_children`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Resource {
    /// Rays of all bounces of a batch: the ray queue.
    Rays,
    /// The closest hit of each ray.
    Hits,
    /// The kinds of each ray's children, the rays that go on from its hit: reflected, refracted, both or none. In
    /// frames of paths: whether each path goes on, and whether it has a shadow ray.
    ChildKinds,
    /// Index in `Rays` at which each ray's children begin, or would begin if it had any.
    FirstChildren,
    /// The number of children of each block of rays, then the exclusive prefix sums of these numbers. In frames of
    /// paths, two numbers for each block: of paths that go on, and of shadow rays.
    ScanBlocks,
    /// The number of rays of each bounce, and the sizes of its dispatches.
    Bounces,
    /// For each light and each hit: whether the light is visible, in shadow or untested.
    LightVisibility,
    /// The radiance that each ray contributes to its pixel, weighted by the ray's throughput.
    RayRadiance,
    /// The sample's radiance in each pixel, then the mean of all samples. The layers of light follow, if the picture
    /// has them.
    PixelRadiance,
    /// The sum of the radiances of all samples of each pixel.
    PixelAccumulated,
    /// The radiance of each pixel after the noise filter; the same buffer as `PixelRadiance` if there is no filter. The
    /// filter `edge` also keeps the light here that it has blurred so far.
    PixelFiltered,
    /// Each pixel as it is displayed, sRGB bytes.
    PixelDisplay,
    /// What each pixel shows, and what its rays cost.
    PixelAovs,
    /// What the noise filter `edge` knows of each pixel beside its colour.
    PixelAux,
    /// Index of the triangle that the graphics pipeline found in each pixel.
    TriangleIds,
    /// The nearest triangle in each pixel and its distance, as found by the compute kernels that rasterize.
    PixelNearest,
    /// Triangles with large bounding rectangles, which `RasterizeBlocks` rasterizes, their number and that of their
    /// blocks, and the size of its dispatch.
    RasterGroups,
    /// Numbers of hits and of shadow rays of each bounce of each batch.
    Counters,
    /// States of suspended rays: rays that have spent the loop iterations of a dispatch and go on in a further
    /// dispatch.
    SuspendedRays,
    /// Radiance of each path so far, and the pdf of its last direction.
    PathStates,
    /// The shadow ray of each path from its last hit to a sampled light.
    ShadowRays,
    /// The indices of the paths that are alive, for this bounce and the next, and of those with a shadow ray.
    LivePaths,
    /// The radiance of each path when the last layer of light was complete.
    PathSnapshots,
}

impl Resource {
    /// Every resource.
    pub const ALL: [Self; 23] = [
        Self::Rays,
        Self::Hits,
        Self::ChildKinds,
        Self::FirstChildren,
        Self::ScanBlocks,
        Self::Bounces,
        Self::LightVisibility,
        Self::RayRadiance,
        Self::PixelRadiance,
        Self::PixelAccumulated,
        Self::PixelFiltered,
        Self::PixelDisplay,
        Self::PixelAovs,
        Self::PixelAux,
        Self::TriangleIds,
        Self::PixelNearest,
        Self::RasterGroups,
        Self::Counters,
        Self::SuspendedRays,
        Self::PathStates,
        Self::ShadowRays,
        Self::LivePaths,
        Self::PathSnapshots,
    ];

    /// Returns its binding in the frame's descriptor set.
    pub fn binding(self) -> u32 {
        match self {
            Self::Rays => layout::BIND_RAYS,
            Self::Hits => layout::BIND_HITS,
            Self::ChildKinds => layout::BIND_CHILD_KINDS,
            Self::FirstChildren => layout::BIND_FIRST_CHILDREN,
            Self::ScanBlocks => layout::BIND_SCAN_BLOCKS,
            Self::Bounces => layout::BIND_BOUNCES,
            Self::LightVisibility => layout::BIND_LIGHT_VISIBILITY,
            Self::RayRadiance => layout::BIND_RAY_RADIANCE,
            Self::PixelRadiance => layout::BIND_PIXEL_RADIANCE,
            Self::PixelAccumulated => layout::BIND_PIXEL_ACCUMULATED,
            Self::PixelFiltered => layout::BIND_PIXEL_FILTERED,
            Self::PixelDisplay => layout::BIND_PIXEL_DISPLAY,
            Self::PixelAovs => layout::BIND_PIXEL_AOVS,
            Self::PixelAux => layout::BIND_PIXEL_AUX,
            Self::TriangleIds => layout::BIND_TRIANGLE_IDS,
            Self::PixelNearest => layout::BIND_PIXEL_NEAREST,
            Self::RasterGroups => layout::BIND_RASTER_GROUPS,
            Self::Counters => layout::BIND_COUNTERS,
            Self::SuspendedRays => layout::BIND_SUSPENDED_RAYS,
            Self::PathStates => layout::BIND_PATH_STATES,
            Self::ShadowRays => layout::BIND_SHADOW_RAYS,
            Self::LivePaths => layout::BIND_LIVE_PATHS,
            Self::PathSnapshots => layout::BIND_PATH_SNAPSHOTS,
        }
    }
}
