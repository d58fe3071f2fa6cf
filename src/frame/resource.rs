//! What the passes of a frame hand to one another.

use crate::layout;

/// A buffer or image that some pass writes, by the name that it has in the kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Resource {
    /// Rays of all bounces of a batch.
    Rays,
    /// The closest hit of each ray.
    Hits,
    /// Which rays go on from each hit.
    ChildKinds,
    /// Where each ray's children begin in `Rays`.
    FirstChildren,
    /// Counts, then prefix sums, of each block of rays.
    ScanBlocks,
    /// The number of rays of each bounce, and the sizes of its dispatches.
    Bounces,
    /// Whether each hit sees each light.
    LightVisibility,
    /// The radiance that each ray brings to its pixel.
    RayRadiance,
    /// The sample's radiance in each pixel, then the mean of all samples.
    PixelRadiance,
    /// The sum of samples in each pixel.
    PixelAccumulated,
    /// Each pixel after the noise filter; the same buffer as `PixelRadiance` where there is no filter.
    PixelFiltered,
    /// Each pixel as it is displayed.
    PixelDisplay,
    /// What each pixel shows, and what its rays cost.
    PixelFeatures,
    /// The triangle that the graphics pipeline found in each pixel.
    TriangleIds,
    /// The triangle and the distance that the kernels which rasterize found in each pixel.
    PixelNearest,
    /// The dispatch of `RasterizeBlocks`, and the numbers of large triangles and of their blocks.
    RasterGroups,
    /// Triangles that cover many pixels.
    LargeTriangles,
    /// Numbers of hits and of shadow segments of each bounce.
    Counters,
    /// Rays that have spent a dispatch's loop turns.
    Stalls,
}

impl Resource {
    /// Every resource.
    pub const ALL: [Self; 19] = [
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
        Self::PixelFeatures,
        Self::TriangleIds,
        Self::PixelNearest,
        Self::RasterGroups,
        Self::LargeTriangles,
        Self::Counters,
        Self::Stalls,
    ];

    /// Its binding in the frame's descriptor set.
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
            Self::PixelFeatures => layout::BIND_PIXEL_FEATURES,
            Self::TriangleIds => layout::BIND_TRIANGLE_IDS,
            Self::PixelNearest => layout::BIND_PIXEL_NEAREST,
            Self::RasterGroups => layout::BIND_RASTER_GROUPS,
            Self::LargeTriangles => layout::BIND_LARGE_TRIANGLES,
            Self::Counters => layout::BIND_COUNTERS,
            Self::Stalls => layout::BIND_STALLS,
        }
    }
}
