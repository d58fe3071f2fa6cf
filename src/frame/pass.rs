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

impl Info {
    /// A pass that reads and writes no resource, and whose size the host sets.
    const fn new(pass: Pass, name: &'static str, role: Role, scope: Scope, color: [u8; 3]) -> Self {
        Self { pass, name, role, scope, color, reads: &[], writes: &[], indirect: None }
    }

    const fn reads(self, reads: &'static [Resource]) -> Self {
        Self { reads, ..self }
    }

    const fn writes(self, writes: &'static [Resource]) -> Self {
        Self { writes, ..self }
    }

    const fn indirect(self, sizes: Resource) -> Self {
        Self { indirect: Some(sizes), ..self }
    }
}

/// A row for each pass, in the order of [`Pass`].
const TABLE: [Info; 27] = [
    Info::new(Pass::Visibility, "visibility", Role::PrimaryVisibility, Scope::Frame, [120, 190, 255])
        .writes(&[TriangleIds]),
    Info::new(Pass::RasterizeTriangles, "rasterize_triangles", Role::PrimaryVisibility, Scope::Frame, [110, 225, 235])
        .reads(&[PixelNearest, RasterGroups])
        .writes(&[PixelNearest, RasterGroups]),
    Info::new(Pass::RasterizeBlocks, "rasterize_blocks", Role::PrimaryVisibility, Scope::Frame, [60, 160, 170])
        .reads(&[PixelNearest, RasterGroups])
        .writes(&[PixelNearest, RasterGroups])
        .indirect(RasterGroups),
    Info::new(Pass::PrimaryHit, "primary_hit", Role::ClosestHit, Scope::Bounce, [70, 130, 220])
        .reads(&[TriangleIds, PixelNearest, Counters, PixelAovs])
        .writes(&[Hits, Counters, PixelAovs]),
    Info::new(Pass::Trace, "trace", Role::ClosestHit, Scope::Bounce, [240, 130, 60])
        .reads(&[Rays, Hits, Bounces, Counters, PixelAovs, SuspendedRays])
        .writes(&[Hits, Counters, PixelAovs, SuspendedRays])
        .indirect(Bounces),
    Info::new(Pass::PixelAovs, "pixel_aovs", Role::Image, Scope::Bounce, [60, 160, 90])
        .reads(&[Rays, Hits, PixelAovs])
        .writes(&[PixelAovs]),
    Info::new(Pass::SurfaceLayers, "surface_layers", Role::Image, Scope::Bounce, [90, 130, 60])
        .reads(&[Rays, Hits])
        .writes(&[PixelRadiance]),
    Info::new(Pass::CompactReduce, "compact_reduce", Role::Compaction, Scope::Bounce, [200, 90, 110])
        .reads(&[Rays, Hits, Bounces])
        .writes(&[ChildFlags, ScanBlocks])
        .indirect(Bounces),
    Info::new(Pass::CompactSpine, "compact_spine", Role::Compaction, Scope::Bounce, [225, 120, 135])
        .reads(&[ScanBlocks, Bounces])
        .writes(&[ScanBlocks, Bounces]),
    Info::new(Pass::CompactScatter, "compact_scatter", Role::Compaction, Scope::Bounce, [245, 160, 165])
        .reads(&[Rays, Hits, ChildFlags, ScanBlocks, Bounces])
        .writes(&[Rays, FirstChildren])
        .indirect(Bounces),
    Info::new(Pass::Shadow, "shadow", Role::Shadow, Scope::Batch, [150, 110, 200])
        .reads(&[Rays, Hits, Bounces, LightVisibility, PixelAovs, SuspendedRays])
        .writes(&[LightVisibility, PixelAovs, SuspendedRays])
        .indirect(Bounces),
    Info::new(Pass::Shade, "shade", Role::Light, Scope::Batch, [250, 210, 90])
        .reads(&[Rays, Hits, LightVisibility, Bounces, Counters])
        .writes(&[RayRadiance, Counters])
        .indirect(Bounces),
    Info::new(Pass::Resolve, "resolve", Role::Light, Scope::Batch, [110, 200, 120])
        .reads(&[RayRadiance, FirstChildren, Bounces])
        .writes(&[PixelRadiance]),
    Info::new(Pass::Accumulate, "accumulate", Role::Image, Scope::Frame, [210, 180, 240])
        .reads(&[Bounces, PixelAccumulated, PixelRadiance])
        .writes(&[PixelAccumulated, PixelRadiance]),
    Info::new(Pass::Denoise, "denoise", Role::Image, Scope::Frame, [80, 180, 180])
        .reads(&[PixelRadiance])
        .writes(&[PixelFiltered]),
    Info::new(Pass::FalseColor, "false_color", Role::Image, Scope::Frame, [190, 140, 140])
        .reads(&[PixelAovs])
        .writes(&[PixelDisplay]),
    Info::new(Pass::Tonemap, "tonemap", Role::Image, Scope::Frame, [170, 170, 170])
        .reads(&[PixelFiltered])
        .writes(&[PixelDisplay]),
    Info::new(Pass::PathBegin, "path_begin", Role::PrimaryVisibility, Scope::Bounce, [90, 160, 235])
        .writes(&[Rays, PathStates, ShadowRays, LivePaths]),
    Info::new(Pass::PathTrace, "path_trace", Role::ClosestHit, Scope::Bounce, [235, 110, 40])
        .reads(&[Rays, Hits, LivePaths, Bounces, PathStates, ShadowRays, Counters, PixelAovs, SuspendedRays])
        .writes(&[Hits, PathStates, ShadowRays, Counters, PixelAovs, SuspendedRays])
        .indirect(Bounces),
    Info::new(Pass::PathScatter, "path_scatter", Role::Light, Scope::Bounce, [240, 200, 70])
        .reads(&[Rays, Hits, LivePaths, Bounces, PathStates])
        .writes(&[Rays, PathStates, ShadowRays, ChildFlags, ScanBlocks])
        .indirect(Bounces),
    Info::new(Pass::PathCompact, "path_compact", Role::Compaction, Scope::Bounce, [250, 150, 150])
        .reads(&[ChildFlags, ScanBlocks, Bounces, LivePaths])
        .writes(&[LivePaths])
        .indirect(Bounces),
    Info::new(Pass::PathLayers, "path_layers", Role::Light, Scope::Bounce, [150, 190, 80])
        .reads(&[PathStates, PathSnapshots])
        .writes(&[PathSnapshots, PixelRadiance]),
    Info::new(Pass::PathResolve, "path_resolve", Role::Light, Scope::Batch, [100, 190, 110])
        .reads(&[PathStates])
        .writes(&[PixelRadiance]),
    Info::new(Pass::PathAccumulate, "path_accumulate", Role::Image, Scope::Frame, [200, 170, 230])
        .reads(&[PixelAccumulated, PixelRadiance])
        .writes(&[PixelAccumulated, PixelRadiance]),
    Info::new(Pass::Auxiliary, "auxiliary", Role::Image, Scope::Bounce, [50, 150, 110])
        .reads(&[Hits, PathStates, PixelAux])
        .writes(&[PixelAux]),
    Info::new(Pass::Demodulate, "demodulate", Role::Image, Scope::Frame, [70, 200, 170])
        .reads(&[PixelRadiance, PixelAux])
        .writes(&[PixelFiltered]),
    Info::new(Pass::AtrousFilter, "atrous_filter", Role::Image, Scope::Frame, [80, 170, 190])
        .reads(&[PixelAux, PixelFiltered])
        .writes(&[PixelFiltered]),
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
