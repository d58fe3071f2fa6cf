//! The buffers and images by which the passes of a frame hand data to one another.

use crate::layout;

/// Calls a macro with a row for each resource: its name, its binding in the frame's descriptor set, whose number is in
/// layout.glsl, and its place in [`Resources`](crate::buffers::Resources). The rows are grouped by the frames whose
/// descriptor set has them.
macro_rules! for_resources {
    ($with:ident) => {
        $with! {
            // Resources of all frames.
            all {
                /// Rays of all bounces of a batch: the ray queue.
                Rays(BIND_RAYS, queue.rays),
                /// The closest hit of each ray.
                Hits(BIND_HITS, queue.hits),
                /// Flags of each ray's children, the rays that go on from its hit: reflected, refracted, both or
                /// none. In frames of paths: whether each path goes on, and whether it has a shadow ray.
                ChildFlags(BIND_CHILD_FLAGS, queue.child_flags),
                /// The number of children of each block of rays, then the exclusive prefix sums of these numbers. In
                /// frames of paths, two numbers for each block: of paths that go on, and of shadow rays.
                ScanBlocks(BIND_SCAN_BLOCKS, queue.scan_blocks),
                /// The number of rays of each bounce, and the sizes of its dispatches.
                Bounces(BIND_BOUNCES, bounces),
                /// The sample's radiance in each pixel, then the mean of all samples. The layers of light follow, if
                /// the picture has them.
                PixelRadiance(BIND_PIXEL_RADIANCE, pixels.pixel_radiance),
                /// The sum of the radiances of all samples of each pixel.
                PixelAccumulated(BIND_PIXEL_ACCUMULATED, pixels.accumulated()),
                /// The radiance of each pixel after the noise filter; the same buffer as `PixelRadiance` if there is no
                /// filter. The filter `edge` also keeps the light here that it has blurred so far.
                PixelFiltered(BIND_PIXEL_FILTERED, pixels.filtered()),
                /// Each pixel as it is displayed, sRGB bytes.
                PixelDisplay(BIND_PIXEL_DISPLAY, pixels.pixel_display),
                /// What each pixel shows, and what its rays cost.
                PixelAovs(BIND_PIXEL_AOVS, pixels.pixel_aovs),
                /// Index of the triangle that the graphics pipeline found in each pixel.
                TriangleIds(BIND_TRIANGLE_IDS, pixels.triangle_ids),
                /// Numbers of hits and of shadow rays of each bounce of each batch.
                Counters(BIND_COUNTERS, counters),
            }
            // Resources that only frames of ray trees have.
            whitted {
                /// Index in `Rays` at which each ray's children begin, or would begin if it had any.
                FirstChildren(BIND_FIRST_CHILDREN, queue.first_children),
                /// For each light and each hit: whether the light is visible, in shadow or untested.
                LightVisibility(BIND_LIGHT_VISIBILITY, queue.light_visibility),
                /// The radiance that each ray contributes to its pixel, weighted by the ray's throughput.
                RayRadiance(BIND_RAY_RADIANCE, queue.ray_radiance),
                /// The nearest triangle in each pixel and its distance, as found by the compute kernels that rasterize.
                PixelNearest(BIND_PIXEL_NEAREST, pixels.pixel_nearest),
                /// Triangles with large bounding rectangles, which `RasterizeBlocks` rasterizes, their number and that
                /// of their blocks, and the size of its dispatch.
                RasterGroups(BIND_RASTER_GROUPS, raster.groups),
            }
            // Resources that only frames of paths have.
            paths {
                /// Radiance of each path so far, and the pdf of its last direction.
                PathStates(BIND_PATH_STATES, paths().path_states),
                /// The shadow ray of each path from its last hit to a sampled light.
                ShadowRays(BIND_SHADOW_RAYS, paths().shadow_rays),
                /// The indices of the paths that are alive, for this bounce and the next, and of those with a shadow
                /// ray.
                LivePaths(BIND_LIVE_PATHS, paths().live_paths),
                /// What the noise filter `edge` knows of each pixel beside its colour.
                PixelAux(BIND_PIXEL_AUX, pixels.pixel_aux),
                /// The radiance of each path when the last layer of light was complete.
                PathSnapshots(BIND_PATH_SNAPSHOTS, paths().path_snapshots),
            }
            // This one is bound with the acceleration structure, since casts need it, too.
            accel {
                /// States of suspended rays: rays that have spent the loop iterations of a dispatch and go on in a
                /// further dispatch.
                SuspendedRays(BIND_SUSPENDED_RAYS, accel.suspended_rays),
            }
        }
    };
}
pub(crate) use for_resources;

macro_rules! declare {
    ($($group:ident { $($(#[doc = $doc:literal])* $name:ident($binding:ident, $($place:tt)+),)* })*) => {
        /// A buffer or image that some pass writes. Kernels have it under the same name in snake case, as
        /// `first_children`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Resource {
            $($($(#[doc = $doc])* $name,)*)*
        }

        impl Resource {
            /// Every resource.
            pub const ALL: [Self; [$($(layout::$binding,)*)*].len()] = [$($(Self::$name,)*)*];

            /// Returns its binding in the frame's descriptor set.
            pub fn binding(self) -> u32 {
                match self {
                    $($(Self::$name => layout::$binding,)*)*
                }
            }
        }
    };
}

for_resources!(declare);
