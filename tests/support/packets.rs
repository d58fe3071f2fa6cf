//! Traces rays as packets, and one by one through a wide hierarchy.

use fearless_simd::{Level, Simd};
use glam::Vec3;
use kdray::{
    accel::{kdtree::Traversal, wide_bvh::WideBvh},
    cpu::{tracer::FastTracer, wide_traverser::WideTraverser},
    layout::{Hit, NO_TRIANGLE, PathRay},
    reference::{inputs::KernelInputs, search_ray::SearchRay, traverser::Tracer},
};
use rayon::prelude::*;

use super::{MeshWithTree, compare::first_difference};

/// Returns the instruction sets that the machine has, the baseline first.
pub fn simd_levels() -> Vec<Level> {
    let mut simd_levels = vec![Level::baseline()];
    #[cfg(target_arch = "x86_64")]
    {
        let best = Level::new();
        simd_levels.extend(best.as_sse4_2().map(Simd::level));
        simd_levels.extend(best.as_avx2().map(Simd::level));
        simd_levels.extend(best.as_avx512().map(Simd::level));
    }
    simd_levels
}

/// Returns the hits of rays that are traced as packets, with the instructions of a SIMD level.
pub fn traced<const ANY_HIT: bool>(world: &MeshWithTree, simd_level: Level, rays: &[PathRay]) -> Vec<Hit> {
    traced_by::<ANY_HIT>(
        &world.inputs(),
        FastTracer::at_simd_level(&world.inputs(), Traversal::Stack, simd_level),
        rays,
    )
}

/// Returns the hits of rays that are traced one by one through a wide hierarchy.
pub fn traced_one_by_one<const ANY_HIT: bool>(
    inputs: &KernelInputs,
    bvh: &WideBvh,
    simd_level: Level,
    rays: &[PathRay],
) -> Vec<Hit> {
    let of_task = |rays: &[PathRay]| traced_by::<ANY_HIT>(inputs, WideTraverser::new(bvh, simd_level), rays);
    rays.par_chunks(1001).flat_map_iter(of_task).collect()
}

/// Compares the hits of rays that are traced one by one through the wide hierarchy of the world's kd-tree with what is
/// expected: the closest hits bit for bit, and of any hits, which rays have one. If a direction is so short that its
/// length underflows, every t is infinite. Of such a ray, the test only demands that its search ends.
pub fn check_one_by_one(world: &MeshWithTree, simd_level: Level, rays: &[PathRay], expected: &[Hit]) {
    let (bvh, inputs) = (WideBvh::new(world.tree(), &world.triangles), world.inputs());
    let mut closest = traced_one_by_one::<false>(&inputs, &bvh, simd_level, rays);
    let mut any = traced_one_by_one::<true>(&inputs, &bvh, simd_level, rays);
    let underflows = |direction: Vec3| direction != Vec3::ZERO && direction.length_squared() < f32::MIN_POSITIVE;
    for (i, _) in rays.iter().enumerate().filter(|(_, ray)| underflows(ray.direction)) {
        (closest[i], any[i]) = (expected[i], expected[i]);
    }
    assert_eq!(first_difference(rays, expected, &closest), None, "one by one, {simd_level:?}");
    let is_hit = |hit: &Hit| hit.triangle_ix != NO_TRIANGLE;
    assert!(any.iter().map(is_hit).eq(expected.iter().map(is_hit)), "one by one, {simd_level:?}");
}

fn traced_by<const ANY_HIT: bool>(inputs: &KernelInputs, mut tracer: impl Tracer, rays: &[PathRay]) -> Vec<Hit> {
    let mut hits = vec![None; rays.len()];
    let search_rays = hits.iter_mut().zip(rays.iter().map(SearchRay::from));
    tracer.trace_all::<ANY_HIT, _>(inputs, search_rays, |place, hit| {
        assert_eq!(place.replace(hit), None, "a ray has one hit");
    });
    hits.into_iter().map(|hit| hit.expect("a ray has a hit")).collect()
}
