//! Tests that rays pass through hidden triangles, on the device and on the CPU: they find what they would find in a
//! mesh without these triangles.

use crate::support::{
    MeshWithTree, compare, device, meshes, n_outliers, packets::traced_one_by_one, random::Random, rays::nasty_ray,
};
use fearless_simd::Level;
use glam::Vec3;
use kdray::{
    accel::{Query, kdtree::Traversal, wide_bvh::WideBvh},
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, Ray},
    layout::{TRIANGLE_HIDDEN, Triangle},
    reference::{
        brute,
        search_ray::SearchRay,
        traversal_ray::hit_from_near,
        traverser::{Tracer, Traverser},
    },
};

const MISS: Hit = Hit { t: f32::INFINITY, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 };

/// A mesh, and the indices of its hidden triangles.
struct Case {
    mesh: MeshWithTree,
    hidden: Vec<u32>,
}

impl Case {
    /// Hides about half of the triangles.
    fn new(triangles: Vec<Triangle>) -> Self {
        let mut random = Random(5);
        let hidden = (0..triangles.len() as u32).filter(|_| random.below(2) == 0).collect();
        Self { mesh: MeshWithTree::new(triangles), hidden }
    }

    fn rays(&self) -> Vec<Ray> {
        let ray = |i| nasty_ray(&mut Random(i as u64), &self.mesh, i);
        let cast_ray = |i| Ray { origin: ray(i).origin, t_min: 0.0, direction: ray(i).direction, t_max: ray(i).t_max };
        (0..3000).map(cast_ray).collect()
    }

    /// Returns the closest hits by a test of every triangle that is not hidden.
    fn by_brute_force(&self, rays: &[Ray]) -> Vec<Hit> {
        let all = &self.mesh.triangles;
        let visible: Vec<u32> = (0..all.len() as u32).filter(|ix| !self.hidden.contains(ix)).collect();
        let triangles: Vec<Triangle> = visible.iter().map(|&ix| all[ix as usize]).collect();
        let hit_of = |ray: &Ray| {
            let &Ray { origin, t_min, direction, t_max } = ray;
            let search_ray = SearchRay { origin, t_min, direction, t_max, source_triangle: NO_TRIANGLE, alpha_seed: 0 };
            let hit = hit_from_near(&self.mesh.inputs(), &search_ray, |near, best| {
                *best = brute::closest_hit(&triangles, near);
            });
            if hit.triangle_ix == NO_TRIANGLE {
                return MISS;
            }
            Hit { triangle_ix: visible[hit.triangle_ix as usize], ..hit }
        };
        rays.iter().map(hit_of).collect()
    }
}

/// Each triangle of the second mesh is there three times. If one copy is hidden, a ray hits another.
fn cases() -> [Case; 3] {
    [meshes::soup(600, 3), meshes::threefold(meshes::torus(20, 10)), meshes::cube(6, 0.0)].map(Case::new)
}

fn occluded(hits: &[Hit]) -> Vec<bool> {
    hits.iter().map(|hit| hit.triangle_ix != NO_TRIANGLE).collect()
}

#[test]
fn the_device_finds_what_is_not_hidden() {
    let context = device();
    for case in cases() {
        let rays = case.rays();
        let expected = case.by_brute_force(&rays);
        for &traversal in Traversal::ALL {
            let caster = GpuCaster::new(&context, case.mesh.geometry(), traversal).expect("a caster");
            let mut caster = caster.hiding(&case.hidden).expect("hidden triangles");
            let closest = caster.cast(&rays, Query::Closest, 1).expect("a cast").hits;
            compare::hits(n_outliers(&context, rays.len()), &expected, &closest)
                .unwrap_or_else(|e| panic!("{traversal}: {e}"));
            let any = caster.cast(&rays, Query::Any, 1).expect("a cast").hits;
            let differing = occluded(&expected).iter().zip(occluded(&any)).filter(|(a, b)| *a != b).count();
            assert!(differing <= n_outliers(&context, rays.len()), "{traversal}: {differing}");
            assert!(any.iter().all(|hit| !case.hidden.contains(&hit.triangle_ix)), "{traversal}");
        }
    }
    assert_eq!(context.validation_messages(), Vec::<String>::new());
}

#[test]
fn the_cpu_finds_what_is_not_hidden() {
    for case in cases() {
        let rays = case.rays();
        let expected = case.by_brute_force(&rays);
        for &traversal in Traversal::ALL {
            let caster =
                CpuCaster::new(case.mesh.geometry(), traversal).hiding(&case.hidden).expect("hidden triangles");
            compare::exact(&expected, &caster.cast(&rays, Query::Closest))
                .unwrap_or_else(|e| panic!("{traversal}: {e}"));
            let any = caster.cast(&rays, Query::Any);
            assert_eq!(occluded(&expected), occluded(&any), "{traversal}");
            assert!(any.iter().all(|hit| !case.hidden.contains(&hit.triangle_ix)), "{traversal}");
        }
    }
}

#[test]
fn single_rays_find_what_is_not_hidden() {
    for case in cases() {
        let word_of = |ix| if case.hidden.contains(&ix) { TRIANGLE_HIDDEN } else { 0 };
        let words: Vec<u32> = (0..case.mesh.triangles.len() as u32).map(word_of).collect();
        let inputs = case.mesh.inputs().with_hidden(&words);
        let rays: Vec<_> = (0..3000).map(|i| nasty_ray(&mut Random(i as u64), &case.mesh, i)).collect();
        let mut reference = Traverser::new(&inputs, Traversal::Mask);
        let expected: Vec<_> = rays.iter().map(|ray| reference.traverse::<false>(&inputs, &ray.into())).collect();
        let bvh = WideBvh::new(case.mesh.tree(), &case.mesh.triangles);
        let found = traced_one_by_one::<false>(&inputs, &bvh, Level::new(), &rays);
        assert_eq!(compare::first_difference(&rays, &expected, &found), None);
        let any = traced_one_by_one::<true>(&inputs, &bvh, Level::new(), &rays);
        assert_eq!(occluded(&expected), occluded(&any));
        assert!(expected.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count() > 300);
    }
}

/// Without a filter the rays hit hidden triangles, so the tests above prove something.
#[test]
fn without_a_filter_hidden_triangles_are_hit() {
    for case in cases() {
        let rays = case.rays();
        let expected = case.by_brute_force(&rays);
        let found = CpuCaster::new(case.mesh.geometry(), Traversal::Mask).cast(&rays, Query::Closest);
        assert!(compare::exact(&expected, &found).is_err());
        assert!(found.iter().filter(|hit| case.hidden.contains(&hit.triangle_ix)).count() > 100);
    }
}

#[test]
fn a_mesh_of_which_all_is_hidden_is_not_there() {
    let mesh = MeshWithTree::new(meshes::cube(2, 0.0));
    let mut traverser = Traverser::new(&mesh.inputs(), Traversal::Mask);
    let into = SearchRay {
        origin: Vec3::new(0.1, 0.2, 9.0),
        t_min: 0.0,
        direction: -Vec3::Z,
        t_max: f32::INFINITY,
        source_triangle: NO_TRIANGLE,
        alpha_seed: 0,
    };
    assert_ne!(traverser.traverse::<false>(&mesh.inputs(), &into).triangle_ix, NO_TRIANGLE);
    let words = vec![TRIANGLE_HIDDEN; mesh.triangles.len()];
    let bindings = mesh.inputs().with_hidden(&words);
    assert_eq!(traverser.traverse::<false>(&bindings, &into).triangle_ix, NO_TRIANGLE);
}
