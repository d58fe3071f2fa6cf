//! The passes of a frame: the role of each one, how often it runs, and what it reads and writes.

use super::resource::{
    Resource,
    Resource::{
        Bounces, ChildFlags, Counters, FirstChildren, Hits, LightVisibility, LivePaths, PathSnapshots, PathStates,
        PixelAccumulated, PixelAovs, PixelAux, PixelDisplay, PixelFiltered, PixelNearest, PixelRadiance, RasterGroups,
        RayRadiance, Rays, ScanBlocks, ShadowRays, SuspendedRays, TriangleIds,
    },
};

/// The purpose of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Finds the triangle that each pixel shows, by rasterization, before any ray is traced.
    PrimaryVisibility,
    /// Finds the closest hits of a bounce's rays.
    ClosestHit,
    /// Tests the shadow rays between hits and lights.
    Shadow,
    /// Computes radiance at the hits, or adds it up in the pixels.
    Light,
    /// Makes the rays of the next bounce, without gaps between them.
    Compaction,
    /// Works on pixels: samples, AOVs, filter, display.
    Image,
}

/// How often a frame runs a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Once, or for a filter of several iterations, once for each.
    Frame,
    /// Once for each batch, for the rays of all its bounces together.
    Batch,
    /// Once for a bounce of a batch, in each bounce that has the pass. Not all bounces have it: `primary_hit`,
    /// `pixel_aovs`, `surface_layers` and `auxiliary` run for bounce 0 only, and the last bounce has no compaction.
    /// `path_layers` runs for the bounces 0 and 1, and once for all others together.
    Bounce,
}

/// One pass. [`Plan`](super::Plan) says when it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Pass {
    /// Rasterizes triangle indices with the graphics pipeline.
    Visibility,
    /// Rasterizes small triangles with a compute kernel, and lists the large ones.
    RasterizeTriangles,
    /// Rasterizes the large triangles, block by block.
    RasterizeBlocks,
    /// Intersects each camera ray with the triangle that was rasterized in its pixel. If the ray just misses that
    /// triangle, the hit is moved to its edge.
    PrimaryHit,
    /// Finds each ray's closest hit through the acceleration structure.
    Trace,
    /// Writes what each pixel's primary ray hits: depth, normal, position, albedo and indices.
    PixelAovs,
    /// Adds up the albedos and the normals that each pixel's camera rays hit.
    SurfaceLayers,
    /// Counts the rays that go on from the hits, the child rays, for each block of rays.
    CompactReduce,
    /// Turns the blocks' counts into prefix sums, and sizes the next bounce.
    CompactSpine,
    /// Writes the next bounce's rays.
    CompactScatter,
    /// Tests the shadow rays from hits to lights.
    Shadow,
    /// Computes the radiance that each ray contributes to its pixel: that of its hit, weighted by its throughput.
    Shade,
    /// Adds up the radiance of each pixel's rays.
    Resolve,
    /// Turns the sample into the mean of all samples.
    Accumulate,
    /// Smooths pixels that differ much from their neighbours.
    Denoise,
    /// Displays an AOV in place of the picture.
    FalseColor,
    /// Encodes radiance for display.
    Tonemap,
    /// Makes the camera rays of a batch's paths.
    PathBegin,
    /// Finds the closest hits of paths, and tests the shadow rays to lights of the bounce before.
    PathTrace,
    /// Adds the light that paths meet, samples lights at their hits, and the directions in which they go on.
    PathScatter,
    /// Lists the paths that go on, and those with a shadow ray to a light, without gaps.
    PathCompact,
    /// Adds up one layer of the light of each pixel's paths: emission, direct or indirect light.
    PathLayers,
    /// Adds up the radiance of each pixel's paths.
    PathResolve,
    /// Turns the sum of the frame's samples into the mean of all samples.
    PathAccumulate,
    /// Adds the first hits of paths to what the noise filter `edge` knows of their pixels.
    Auxiliary,
    /// Divides the light of each pixel by the albedo of what it shows, and estimates its variance.
    Demodulate,
    /// Blurs the light within surfaces: one iteration of the noise filter `edge`.
    AtrousFilter,
}

/// The properties of a pass, the same in every frame.
struct Info {
    pass: Pass,
    name: &'static str,
    role: Role,
    scope: Scope,
    color: [u8; 3],
    reads: &'static [Resource],
    writes: &'static [Resource],
    /// The buffer that holds the size of the pass's indirect dispatch; None if the host sets the size.
    indirect: Option<Resource>,
}

/// A row for each pass, in the order of [`Pass`].
const TABLE: [Info; 27] = [
    Info {
        pass: Pass::Visibility,
        name: "visibility",
        role: Role::PrimaryVisibility,
        scope: Scope::Frame,
        color: [120, 190, 255],
        reads: &[],
        writes: &[TriangleIds],
        indirect: None,
    },
    Info {
        pass: Pass::RasterizeTriangles,
        name: "rasterize_triangles",
        role: Role::PrimaryVisibility,
        scope: Scope::Frame,
        color: [110, 225, 235],
        reads: &[PixelNearest, RasterGroups],
        writes: &[PixelNearest, RasterGroups],
        indirect: None,
    },
    Info {
        pass: Pass::RasterizeBlocks,
        name: "rasterize_blocks",
        role: Role::PrimaryVisibility,
        scope: Scope::Frame,
        color: [60, 160, 170],
        reads: &[PixelNearest, RasterGroups],
        writes: &[PixelNearest, RasterGroups],
        indirect: Some(RasterGroups),
    },
    Info {
        pass: Pass::PrimaryHit,
        name: "primary_hit",
        role: Role::ClosestHit,
        scope: Scope::Bounce,
        color: [70, 130, 220],
        reads: &[TriangleIds, PixelNearest, Counters, PixelAovs],
        writes: &[Hits, Counters, PixelAovs],
        indirect: None,
    },
    Info {
        pass: Pass::Trace,
        name: "trace",
        role: Role::ClosestHit,
        scope: Scope::Bounce,
        color: [240, 130, 60],
        reads: &[Rays, Hits, Bounces, Counters, PixelAovs, SuspendedRays],
        writes: &[Hits, Counters, PixelAovs, SuspendedRays],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::PixelAovs,
        name: "pixel_aovs",
        role: Role::Image,
        scope: Scope::Bounce,
        color: [60, 160, 90],
        reads: &[Rays, Hits, PixelAovs],
        writes: &[PixelAovs],
        indirect: None,
    },
    Info {
        pass: Pass::SurfaceLayers,
        name: "surface_layers",
        role: Role::Image,
        scope: Scope::Bounce,
        color: [90, 130, 60],
        reads: &[Rays, Hits],
        writes: &[PixelRadiance],
        indirect: None,
    },
    Info {
        pass: Pass::CompactReduce,
        name: "compact_reduce",
        role: Role::Compaction,
        scope: Scope::Bounce,
        color: [200, 90, 110],
        reads: &[Rays, Hits, Bounces],
        writes: &[ChildFlags, ScanBlocks],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::CompactSpine,
        name: "compact_spine",
        role: Role::Compaction,
        scope: Scope::Bounce,
        color: [225, 120, 135],
        reads: &[ScanBlocks, Bounces],
        writes: &[ScanBlocks, Bounces],
        indirect: None,
    },
    Info {
        pass: Pass::CompactScatter,
        name: "compact_scatter",
        role: Role::Compaction,
        scope: Scope::Bounce,
        color: [245, 160, 165],
        reads: &[Rays, Hits, ChildFlags, ScanBlocks, Bounces],
        writes: &[Rays, FirstChildren],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::Shadow,
        name: "shadow",
        role: Role::Shadow,
        scope: Scope::Batch,
        color: [150, 110, 200],
        reads: &[Rays, Hits, Bounces, LightVisibility, PixelAovs, SuspendedRays],
        writes: &[LightVisibility, PixelAovs, SuspendedRays],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::Shade,
        name: "shade",
        role: Role::Light,
        scope: Scope::Batch,
        color: [250, 210, 90],
        reads: &[Rays, Hits, LightVisibility, Bounces, Counters],
        writes: &[RayRadiance, Counters],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::Resolve,
        name: "resolve",
        role: Role::Light,
        scope: Scope::Batch,
        color: [110, 200, 120],
        reads: &[RayRadiance, FirstChildren, Bounces],
        writes: &[PixelRadiance],
        indirect: None,
    },
    Info {
        pass: Pass::Accumulate,
        name: "accumulate",
        role: Role::Image,
        scope: Scope::Frame,
        color: [210, 180, 240],
        reads: &[Bounces, PixelAccumulated, PixelRadiance],
        writes: &[PixelAccumulated, PixelRadiance],
        indirect: None,
    },
    Info {
        pass: Pass::Denoise,
        name: "denoise",
        role: Role::Image,
        scope: Scope::Frame,
        color: [80, 180, 180],
        reads: &[PixelRadiance],
        writes: &[PixelFiltered],
        indirect: None,
    },
    Info {
        pass: Pass::FalseColor,
        name: "false_color",
        role: Role::Image,
        scope: Scope::Frame,
        color: [190, 140, 140],
        reads: &[PixelAovs],
        writes: &[PixelDisplay],
        indirect: None,
    },
    Info {
        pass: Pass::Tonemap,
        name: "tonemap",
        role: Role::Image,
        scope: Scope::Frame,
        color: [170, 170, 170],
        reads: &[PixelFiltered],
        writes: &[PixelDisplay],
        indirect: None,
    },
    Info {
        pass: Pass::PathBegin,
        name: "path_begin",
        role: Role::PrimaryVisibility,
        scope: Scope::Bounce,
        color: [90, 160, 235],
        reads: &[],
        writes: &[Rays, PathStates, ShadowRays, LivePaths],
        indirect: None,
    },
    Info {
        pass: Pass::PathTrace,
        name: "path_trace",
        role: Role::ClosestHit,
        scope: Scope::Bounce,
        color: [235, 110, 40],
        reads: &[Rays, Hits, LivePaths, Bounces, PathStates, ShadowRays, Counters, PixelAovs, SuspendedRays],
        writes: &[Hits, PathStates, ShadowRays, Counters, PixelAovs, SuspendedRays],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::PathScatter,
        name: "path_scatter",
        role: Role::Light,
        scope: Scope::Bounce,
        color: [240, 200, 70],
        reads: &[Rays, Hits, LivePaths, Bounces, PathStates],
        writes: &[Rays, PathStates, ShadowRays, ChildFlags, ScanBlocks],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::PathCompact,
        name: "path_compact",
        role: Role::Compaction,
        scope: Scope::Bounce,
        color: [250, 150, 150],
        reads: &[ChildFlags, ScanBlocks, Bounces, LivePaths],
        writes: &[LivePaths],
        indirect: Some(Bounces),
    },
    Info {
        pass: Pass::PathLayers,
        name: "path_layers",
        role: Role::Light,
        scope: Scope::Bounce,
        color: [150, 190, 80],
        reads: &[PathStates, PathSnapshots],
        writes: &[PathSnapshots, PixelRadiance],
        indirect: None,
    },
    Info {
        pass: Pass::PathResolve,
        name: "path_resolve",
        role: Role::Light,
        scope: Scope::Batch,
        color: [100, 190, 110],
        reads: &[PathStates],
        writes: &[PixelRadiance],
        indirect: None,
    },
    Info {
        pass: Pass::PathAccumulate,
        name: "path_accumulate",
        role: Role::Image,
        scope: Scope::Frame,
        color: [200, 170, 230],
        reads: &[PixelAccumulated, PixelRadiance],
        writes: &[PixelAccumulated, PixelRadiance],
        indirect: None,
    },
    Info {
        pass: Pass::Auxiliary,
        name: "auxiliary",
        role: Role::Image,
        scope: Scope::Bounce,
        color: [50, 150, 110],
        reads: &[Hits, PathStates, PixelAux],
        writes: &[PixelAux],
        indirect: None,
    },
    Info {
        pass: Pass::Demodulate,
        name: "demodulate",
        role: Role::Image,
        scope: Scope::Frame,
        color: [70, 200, 170],
        reads: &[PixelRadiance, PixelAux],
        writes: &[PixelFiltered],
        indirect: None,
    },
    Info {
        pass: Pass::AtrousFilter,
        name: "atrous_filter",
        role: Role::Image,
        scope: Scope::Frame,
        color: [80, 170, 190],
        reads: &[PixelAux, PixelFiltered],
        writes: &[PixelFiltered],
        indirect: None,
    },
];

impl Pass {
    /// Returns every pass that a frame can have, on the GPU and on the CPU.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|info| info.pass)
    }

    fn info(self) -> &'static Info {
        &TABLE[self as usize]
    }

    /// Returns the name of its kernel's file, which is also its debug label and its name in a profile.
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// Returns its purpose.
    pub fn role(self) -> Role {
        self.info().role
    }

    /// Returns how often a frame runs it.
    pub fn scope(self) -> Scope {
        self.info().scope
    }

    /// Returns its colour in graphs, sRGB.
    pub fn color(self) -> [u8; 3] {
        self.info().color
    }

    /// Returns the resources that its kernel declares as readable, without the scene's arrays, which no pass writes.
    pub fn reads(self) -> &'static [Resource] {
        self.info().reads
    }

    /// Returns the resources that its kernel declares as writable. Most kernels write only parts of them, and
    /// `rasterize_blocks` writes only `PixelNearest`: it includes the others with `rasterize/rasterize.glsl`.
    pub fn writes(self) -> &'static [Resource] {
        self.info().writes
    }

    /// Returns the buffer from which the device reads the size of its dispatch, if it is an indirect one.
    pub fn indirect(self) -> Option<Resource> {
        self.info().indirect
    }

    /// Returns the pass of this name.
    ///
    /// # Panics
    /// No pass of a frame has that name.
    pub fn named(name: &str) -> Self {
        let info = TABLE.iter().find(|info| info.name == name);
        info.unwrap_or_else(|| panic!("`{name}` is missing in the table of a frame's passes")).pass
    }

    /// Whether the pass takes part in finding the closest hits of rays, by tracing or by rasterization.
    pub fn finds_hits(self) -> bool {
        matches!(self.role(), Role::PrimaryVisibility | Role::ClosestHit)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_passes() {
        assert!(Pass::all().enumerate().all(|(row, pass)| pass as usize == row));
    }

    #[test]
    fn each_pass_has_a_name_and_a_colour_of_its_own() {
        let names: BTreeSet<_> = Pass::all().map(Pass::name).collect();
        let colors: BTreeSet<_> = Pass::all().map(Pass::color).collect();
        assert_eq!((names.len(), colors.len()), (TABLE.len(), TABLE.len()));
        assert!(Pass::all().all(|pass| Pass::named(pass.name()) == pass && pass.color() != [255; 3]));
    }
}
