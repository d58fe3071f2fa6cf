//! Whether the boxes of instances are large enough (src/accel/top_level.rs). The oracle is exact: a ray that is
//! transformed to an instance's space, as the search transforms it, has a hit in the geometry alone by brute force, or
//! none. Where it has one, the ray of the world has it, too.
//!
//! Small squares lie in a face of their box, far from the world's origin. The rays go to points that are about as far
//! off them as rounding moves rays. A margin of 0 loses hits. The bound is loose: of the margin, some 12 million such
//! hits in a copy of the arithmetic need 3.5 % at most, so that a quarter of it would do for all of them.

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use kdray::{
    accel::{
        Query,
        kdtree::{BuildOptions, Traversal},
    },
    cast::{GpuCaster, Hit, Ray, cast_on_cpu},
    layout::Instance,
    scene::{Mesh, Transform},
    world::{FlatScene, World},
};

use super::{casts, kept, scene_of};
use crate::support::{assert_silent, device, random::Random};

/// A power of ten between two of them.
fn power(random: &mut Random, low: f32, high: f32) -> f64 {
    10f64.powf(f64::from(random.between(low, high)))
}

/// A linear map, and by about how much it magnifies rounding: none, one that makes bodies flat in some direction, or a
/// shear along an axis.
fn linear(random: &mut Random) -> (DMat3, f64) {
    let stretch = power(random, 0.0, 3.0);
    let kind = random.below(3);
    let mut rotation = || DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, random.direction().as_dvec3()));
    let [first, second] = [rotation(), rotation()];
    let (mut shear, to) = (DMat3::IDENTITY, random.below(3));
    shear.col_mut((to + 1) % 3)[to] = stretch;
    shear.col_mut((to + 2) % 3)[to] = stretch * f64::from(random.between(-1.0, 1.0));
    match kind {
        0 => (DMat3::IDENTITY, 1.0),
        1 => (first * DMat3::from_diagonal(DVec3::new(1.0, stretch.recip(), 1.0)) * second, stretch),
        _ => (shear, stretch),
    }
}

/// A square that faces an axis, and rays at it.
struct Square {
    world: World,
    /// The square alone, in its own space.
    alone: World,
    rays: Vec<Ray>,
}

impl Square {
    /// `reach`: the largest coordinate of rays' origins, as a multiple of the world's. Returns none if the linear map
    /// magnifies rounding too much for a space of its own.
    fn new(reach: f64, random: &mut Random) -> Option<Self> {
        let ((linear, stretch), axis) = (linear(random), random.below(3));
        let side = |random: &mut Random| f64::from(random.between(1.0, 1.1)) * [-1.0, 1.0][random.below(2)];
        let centre = DVec3::new(side(random), side(random), side(random));
        let slope = power(random, -1.0, 0.0);
        let rounding = stretch * reach * 2f64.powi(-24);
        let half = (rounding / slope * power(random, -2.0, 0.0)).min(0.02);
        let corner = |(x, y): (f64, f64)| {
            let mut offset = DVec3::ZERO;
            (offset[(axis + 1) % 3], offset[(axis + 2) % 3]) = (half * x, half * y);
            (linear.inverse() * offset).as_vec3()
        };
        let positions = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner).to_vec();
        let mut affine = DMat4::from_mat3(linear);
        affine.w_axis = centre.extend(1.0);
        let mut scene = scene_of(&[], &[Transform::of_affine(affine).expect("a transform")]);
        scene.meshes = vec![Mesh::of_triangles(positions, vec![[0, 1, 2], [0, 2, 3]])];
        let world = kept(&scene);
        if !world.scene().instances.as_ref().expect("an instance").fixed.is_empty() {
            return None;
        }
        scene.instances[0].transform = Transform::IDENTITY;
        let alone = World::of_flat(FlatScene::new(&scene).expect("a scene"), &BuildOptions::default());
        let grazing = |_| {
            let off = rounding * power(random, -2.0, 0.0);
            let mut size = DVec3::splat(half + off);
            size[axis] = off;
            let target = size * random.in_box(Vec3::NEG_ONE, Vec3::ONE).as_dvec3();
            let mut direction = random.direction().as_dvec3();
            direction[axis] *= slope;
            let target = centre + target;
            // Most rays come from the other side of the world's origin, from where they are as long as can be.
            if random.below(5) > 0 {
                direction = direction.abs() * centre.signum();
            }
            let far = (reach + direction.signum() * target) / direction.abs();
            let distance = far.min_element() * f64::from(random.between(0.2, 1.0));
            let origin = (target - distance * direction).as_vec3();
            let direction = (target - origin.as_dvec3()).normalize().as_vec3();
            Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
        };
        let rays = (0..200).map(grazing).collect();
        Some(Self { world, alone: alone.expect("a world"), rays })
    }

    /// Returns the rays in the square's own space.
    fn local_rays(&self) -> Vec<Ray> {
        let Instance { local_x, local_y, local_z, translation, .. } =
            self.world.scene().instances.as_ref().expect("an instance").list[0];
        let local = |v: Vec3| {
            let by_row = |row: Vec3| row.x * v.x + row.y * v.y + row.z * v.z;
            Vec3::new(by_row(local_x), by_row(local_y), by_row(local_z))
        };
        let local_ray =
            |ray: &Ray| Ray { origin: local(ray.origin - translation), direction: local(ray.direction), ..*ray };
        self.rays.iter().map(local_ray).collect()
    }
}

/// Asserts that rays find what they find in the squares alone, on the CPU and on a device. `reach`: as of
/// [`Square::new`].
fn assert_found(reach: f64, seed: u64) {
    let (context, mut random) = (device(), Random(seed));
    let on_device = |world: &World, traversal: Traversal, rays: &[Ray]| {
        let mut caster = GpuCaster::new(context.clone(), world.geometry(), traversal).expect("a caster");
        caster.cast(rays, Query::Closest, 1).expect("hits").hits
    };
    let on_cpu = |world: &World, traversal: Traversal, rays: &[Ray]| {
        cast_on_cpu(world.geometry(), traversal, rays, Query::Closest)
    };
    let (mut n_hits, mut n_lost) = (0, [0; 3]);
    for square in (0..60).filter_map(|_| Square::new(reach, &mut random)) {
        let local_rays = square.local_rays();
        let of_cpu = on_cpu(&square.alone, Traversal::Brute, &local_rays);
        let of_device = on_device(&square.alone, Traversal::Brute, &local_rays);
        n_hits += casts::n_hits(&of_cpu);
        n_lost[0] += n_differing(&of_cpu, &on_cpu(&square.world, Traversal::Stack, &square.rays));
        n_lost[1] += n_differing(&of_device, &on_device(&square.world, Traversal::Brute, &square.rays));
        n_lost[2] += n_differing(&of_device, &on_device(&square.world, Traversal::Mask, &square.rays));
    }
    assert!(n_hits > 1000 && n_lost == [0; 3], "{n_lost:?} of {n_hits} hits");
    assert_silent(&context);
}

/// The number of rays that hit different triangles, or none.
fn n_differing(a: &[Hit], b: &[Hit]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a.triangle_ix != b.triangle_ix).count()
}

#[test]
fn margins_of_boxes_cover_rounding() {
    assert_found(4.0, 1);
}

#[test]
fn rays_from_afar_meet_larger_boxes() {
    for (reach, seed) in [(40.0, 2), (1e3, 3), (1e5, 4)] {
        assert_found(reach, seed);
    }
}
