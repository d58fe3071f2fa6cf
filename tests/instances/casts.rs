//! Rays at instances.

use glam::Vec3;
use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, Traversal},
    },
    cast::{CpuCaster, GpuCaster, Hit, NO_TRIANGLE, QueryPoint, Ray, cast_on_cpu},
    layout::{INSTANCE_FOR_OTHERS, Triangle},
    scene::{Scene, Transform},
    world::{FlatScene, InstanceUpdate, World},
};

use super::{ball, flattened, kept, scene_of, transforms};
use crate::support::{assert_silent, compare, device, n_outliers, random::Random};

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}

/// Rays from everywhere around some instances, most of them at one of them.
pub fn rays_at(transforms: &[Transform], n: usize) -> Vec<Ray> {
    let mut random = Random(7);
    let mut rays = Vec::with_capacity(n);
    while rays.len() < n {
        let (from, to) = (random.of(transforms), random.of(transforms));
        let origin = from.point(3.0 * random.direction());
        let target = to.point(random.in_box(Vec3::NEG_ONE, Vec3::ONE));
        let direction = if random.below(4) == 0 { random.direction() } else { target - origin };
        rays.push(ray(origin, direction));
    }
    rays
}

/// The number of hits.
pub fn n_hits(hits: &[Hit]) -> usize {
    hits.iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count()
}

#[test]
fn devices_and_the_cpu_find_the_same_hits_by_every_traversal() {
    let transforms = transforms(4.0);
    let world = kept(&scene_of(&ball(), &transforms));
    let rays = rays_at(&transforms, 3000);
    let by_stack = cast_on_cpu(world.geometry(), Traversal::Stack, &rays, Query::Closest);
    assert!(n_hits(&by_stack) > 1500, "{} hits", n_hits(&by_stack));
    let context = device();
    for &traversal in Traversal::ALL {
        let on_cpu = cast_on_cpu(world.geometry(), traversal, &rays, Query::Closest);
        compare::exact(&by_stack, &on_cpu).unwrap_or_else(|what| panic!("{traversal} on the CPU: {what}"));
        let mut caster = GpuCaster::new(context.clone(), world.geometry(), traversal).expect("a caster");
        let closest = caster.cast(&rays, Query::Closest, 1).expect("hits").hits;
        let n_outliers = n_outliers(&context, rays.len()).max(3);
        compare::hits(n_outliers, &by_stack, &closest).unwrap_or_else(|what| panic!("{traversal}: {what}"));
        let any = caster.cast(&rays, Query::Any, 1).expect("hits").hits;
        let are_hit = |hits: &[Hit]| hits.iter().map(|hit| hit.triangle_ix != NO_TRIANGLE).collect::<Vec<_>>();
        compare::exact_but_for(n_outliers, &are_hit(&by_stack), &are_hit(&any))
            .unwrap_or_else(|what| panic!("{traversal}, any: {what}"));
    }
    assert_silent(&context);
}

#[test]
fn instances_and_their_flattened_copies_have_the_same_hits() {
    let transforms = &transforms(4.0)[..5];
    let scene = scene_of(&ball(), transforms);
    let (kept, flat) = (kept(&scene), flattened(&scene));
    let rays = rays_at(transforms, 5000);
    let hits_in = |world: &World| cast_on_cpu(world.geometry(), Traversal::Stack, &rays, Query::Closest);
    let (of_kept, of_flat) = (hits_in(&kept), hits_in(&flat));
    // Rays that graze an edge.
    compare::hits(5, &of_flat, &of_kept).unwrap();
    for ix in 0..flat.scene().n_triangles() {
        let (a, b) = (flat.scene().triangle(ix), kept.scene().triangle(ix));
        assert!(a.v0.distance(b.v0) < 1e-4 && a.v1.distance(b.v1) < 1e-4 && a.v2.distance(b.v2) < 1e-4, "{ix}");
    }
}

/// Rays from points inside a closed mesh, at its corners, edges and faces.
fn rays_from_inside(mesh: &[Triangle], transform: &Transform, n: usize) -> Vec<Ray> {
    let mut random = Random(3);
    let ray_from_inside = |_| {
        let t = random.of(mesh);
        let (a, b) = *random.of(&[(t.v0, t.v1), (t.v1, t.v2), (t.v2, t.v0)]);
        let target = match random.below(3) {
            0 => a,
            1 => a.lerp(b, 0.5),
            _ => a.lerp(b, random.unit()),
        };
        let origin = transform.point(0.3 * random.in_box(Vec3::NEG_ONE, Vec3::ONE));
        ray(origin, (transform.point(target) - origin).normalize_or(Vec3::X))
    };
    (0..n).map(ray_from_inside).collect()
}

#[test]
fn no_ray_leaves_a_closed_instance() {
    let mesh = ball();
    let all = transforms(40.0);
    let world = kept(&scene_of(&mesh, &all));
    let context = device();
    let mut caster = GpuCaster::new(context.clone(), world.geometry(), Traversal::Mask).expect("a caster");
    for (instance_ix, transform) in all.iter().enumerate() {
        let rays = rays_from_inside(&mesh, transform, 4000);
        let on_cpu = cast_on_cpu(world.geometry(), Traversal::Stack, &rays, Query::Closest);
        let on_device = caster.cast(&rays, Query::Closest, 1).expect("hits").hits;
        for hits in [on_cpu, on_device] {
            let own = instance_ix * mesh.len()..(instance_ix + 1) * mesh.len();
            let leaks = hits.iter().filter(|hit| !own.contains(&(hit.triangle_ix as usize))).count();
            assert_eq!(leaks, 0, "of instance {instance_ix}");
        }
    }
    assert_silent(&context);
}

/// Returns the distance of the point that a ray reaches at t from a triangle's plane, as a share of the distance that
/// rounding may cause: computed in double precision.
fn error_of(scene: &Scene, world: &World, ray: &Ray, hit: &Hit) -> f64 {
    let t = world.scene().triangle(hit.triangle_ix as usize);
    let [a, b, c] = [t.v0, t.v1, t.v2].map(Vec3::as_dvec3);
    let normal = (b - a).cross(c - a).normalize();
    let at = ray.origin.as_dvec3() + f64::from(hit.t) * ray.direction.as_dvec3();
    let (min, max) = scene.bounds();
    let reach = [min, max, ray.origin].iter().map(|p| f64::from(p.abs().max_element())).fold(0.0, f64::max);
    (at - a).dot(normal).abs() / (reach * 2f64.powi(-24))
}

#[test]
fn hits_are_where_double_precision_has_them() {
    let transforms = &transforms(4.0)[..5];
    let scene = scene_of(&ball(), transforms);
    let world = kept(&scene);
    let rays = rays_at(transforms, 3000);
    let hits = cast_on_cpu(world.geometry(), Traversal::Stack, &rays, Query::Closest);
    let of_hit = |(ray, hit): (&Ray, &Hit)| match hit.triangle_ix {
        NO_TRIANGLE => 0.0,
        _ => error_of(&scene, &world, ray, hit),
    };
    let worst = rays.iter().zip(&hits).map(of_hit).fold(0.0, f64::max);
    // src/accel/top_level.rs: at most 65 units for each unit of the condition, which is below 8 here.
    assert!(worst < 520.0, "{worst} units of rounding");
}

#[test]
fn rays_from_afar_meet_instances() {
    let transforms = &transforms(4.0)[..5];
    let world = kept(&scene_of(&ball(), transforms));
    let mut random = Random(11);
    for distance in [1e2, 1e4, 1e6] {
        let from_afar = |_: usize| {
            let transform = random.of(transforms);
            let target = transform.point(Vec3::ZERO).as_dvec3();
            let origin = (target + distance * random.direction().as_dvec3()).as_vec3();
            ray(origin, (target - origin.as_dvec3()).normalize().as_vec3())
        };
        let rays: Vec<_> = (0..2000).map(from_afar).collect();
        let hits = cast_on_cpu(world.geometry(), Traversal::Stack, &rays, Query::Closest);
        // The directions of the farthest are rounded by a few hundredths.
        assert_eq!(n_hits(&hits), rays.len(), "from {distance}");
    }
}

#[test]
fn of_two_instances_at_one_place_the_first_is_hit() {
    let twice = [Transform::IDENTITY, Transform::IDENTITY];
    let world = kept(&scene_of(&ball(), &twice));
    let rays = rays_at(&twice, 1000);
    let hits = cast_on_cpu(world.geometry(), Traversal::Stack, &rays, Query::Closest);
    let n_of_first = world.scene().triangles.len() as u32;
    assert!(n_hits(&hits) > 400);
    assert!(hits.iter().all(|hit| hit.triangle_ix == NO_TRIANGLE || hit.triangle_ix < n_of_first));
    let mut caster = GpuCaster::new(device(), world.geometry(), Traversal::OF_GPUS).expect("a caster");
    let on_device = caster.cast(&rays, Query::Closest, 1).expect("hits").hits;
    compare::hits(1, &hits, &on_device).unwrap();
}

#[test]
fn rays_pass_through_hidden_triangles_of_one_instance() {
    let transforms = &transforms(4.0)[..4];
    let mesh = ball();
    let world = kept(&scene_of(&mesh, transforms));
    let rays = rays_at(transforms, 2000);
    let hidden: Vec<u32> = (mesh.len() as u32..2 * mesh.len() as u32).collect();
    let open = CpuCaster::new(world.geometry(), Traversal::Stack).cast(&rays, Query::Closest);
    let caster = CpuCaster::new(world.geometry(), Traversal::Stack).hiding(&hidden).expect("indices of triangles");
    let hits = caster.cast(&rays, Query::Closest);
    let is_hidden = |hit: &Hit| hidden.contains(&hit.triangle_ix);
    assert!(open.iter().filter(|hit| is_hidden(hit)).count() > 100 && !hits.iter().any(is_hidden));
    let caster = GpuCaster::new(device(), world.geometry(), Traversal::OF_GPUS).expect("a caster");
    let on_device = caster.hiding(&hidden).expect("indices of triangles").cast(&rays, Query::Closest, 1).expect("hits");
    compare::hits(2, &hits, &on_device.hits).unwrap();
}

#[test]
fn rays_meet_only_instances_for_their_kind() {
    let mut flat = FlatScene::with_instances(&scene_of(&ball(), &transforms(4.0)[..2])).expect("a scene");
    let instances = flat.instances.as_mut().expect("instances");
    instances.list[1].flags &= !INSTANCE_FOR_OTHERS;
    let world = World::of_flat(flat, &BuildOptions::default()).expect("a world");
    let rays = rays_at(&transforms(4.0)[..2], 1000);
    let hits = cast_on_cpu(world.geometry(), Traversal::Stack, &rays, Query::Closest);
    let n = world.scene().triangles.len() as u32;
    assert!(n_hits(&hits) > 200 && hits.iter().all(|hit| hit.triangle_ix < n || hit.triangle_ix == NO_TRIANGLE));
    let mut caster = GpuCaster::new(device(), world.geometry(), Traversal::OF_GPUS).expect("a caster");
    compare::hits(1, &hits, &caster.cast(&rays, Query::Closest, 1).expect("hits").hits).unwrap();
}

/// The masks of four instances: two have a bit in common, one has another bit, and one has none.
const MASKS: [u8; 4] = [0x81, 0x01, 0x02, 0x00];

/// Casts with masks find what casts without masks find in a world without the other instances.
#[test]
fn casts_meet_the_instances_of_their_mask() {
    let (transforms, mesh) = (&transforms(4.0)[..4], ball());
    let world = kept(&scene_of(&mesh, transforms));
    let update = |(instance_ix, mask)| InstanceUpdate { instance_ix, mask: Some(mask), ..InstanceUpdate::default() };
    let updates: Vec<_> = MASKS.into_iter().enumerate().map(update).collect();
    let masked = world.with_instances_changed(&updates).expect("a world");
    let rays = rays_at(transforms, 1500);
    let point = |ray: &Ray| QueryPoint { position: ray.origin, t_max: f32::INFINITY };
    let points: Vec<_> = rays[..500].iter().map(point).collect();
    let mut on_cpu = CpuCaster::new(masked.geometry(), Traversal::Stack);
    let mut on_device = GpuCaster::new(device(), masked.geometry(), Traversal::OF_GPUS).expect("a caster");
    let mut n_of_masks = Vec::new();
    for mask in [0xff, 0x01, 0x80, 0x82, 0x40] {
        let n = mesh.len() as u32;
        let unmet = (0..4).filter(|ix| MASKS[*ix as usize] & mask == 0).flat_map(|ix| ix * n..(ix + 1) * n);
        let expected = CpuCaster::new(world.geometry(), Traversal::Stack).hiding(&unmet.collect::<Vec<_>>()).unwrap();
        on_cpu.set_mask(mask).expect("a mask");
        on_device.set_mask(mask).expect("a mask");
        let closest = expected.cast(&rays, Query::Closest);
        compare::exact(&closest, &on_cpu.cast(&rays, Query::Closest)).unwrap();
        compare::hits(3, &closest, &on_device.cast(&rays, Query::Closest, 1).expect("hits").hits).unwrap();
        n_of_masks.push(n_hits(&closest));
        assert_eq!(n_hits(&on_cpu.cast(&rays, Query::Any)), n_hits(&closest));
        assert!(n_hits(&on_device.cast(&rays, Query::Any, 1).expect("hits").hits).abs_diff(n_hits(&closest)) < 3);
        let counts = expected.count_hits(&rays);
        assert_eq!(on_cpu.count_hits(&rays), counts);
        compare::exact_but_for(6, &counts, &on_device.count_hits(&rays).expect("counts")).unwrap();
        let nearest = expected.closest_points(&points).expect("points");
        compare::exact(&nearest, &on_cpu.closest_points(&points).expect("points")).unwrap();
        let found = on_device.closest_points(&points, 1).expect("points").hits;
        let differ = |(a, b): (&Hit, &Hit)| a.t != b.t && (a.t - b.t).abs() > 1e-5 * a.t;
        assert!(!nearest.iter().zip(&found).any(differ));
    }
    assert!(n_of_masks.is_sorted_by(|a, b| a != b) && n_of_masks[4] == 0, "{n_of_masks:?}");
    for refused in [on_cpu.set_mask(0), on_device.set_mask(0)] {
        assert_eq!(refused.unwrap_err().to_string(), "mask is 0, not at least 1");
    }
}
