//! Traces rays as packets.

use fearless_simd::{Level, Simd};
use kdray::{
    accel::kdtree::Traversal,
    cpu::tracer::FastTracer,
    layout::{Hit, PathRay},
    reference::{search_ray::SearchRay, traverser::Tracer},
};

use super::MeshWithTree;

/// Returns the instruction sets that the machine has, the baseline first.
pub fn levels() -> Vec<Level> {
    let mut levels = vec![Level::baseline()];
    #[cfg(target_arch = "x86_64")]
    {
        let best = Level::new();
        levels.extend(best.as_sse4_2().map(Simd::level));
        levels.extend(best.as_avx2().map(Simd::level));
        levels.extend(best.as_avx512().map(Simd::level));
    }
    levels
}

/// Returns the hits of rays that are traced as packets, with the instructions of a level.
pub fn traced<const ANY_HIT: bool>(world: &MeshWithTree, level: Level, rays: &[PathRay]) -> Vec<Hit> {
    let mut hits = vec![None; rays.len()];
    let search_rays = hits.iter_mut().zip(rays.iter().map(SearchRay::from));
    let mut tracer = FastTracer::at_level(&world.inputs(), Traversal::Stack, level);
    tracer.trace_all::<ANY_HIT, _>(&world.inputs(), search_rays, |place, hit| {
        assert_eq!(place.replace(hit), None, "a ray has one hit");
    });
    hits.into_iter().map(|hit| hit.expect("a ray has a hit")).collect()
}
