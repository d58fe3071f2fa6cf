//! The test of sixteen rays against all rectangles, disks and spheres that shine. It does the operations of the
//! reference's `hit_area_light`.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*};

use super::vec3x16::Vec3x16;
use crate::layout::{AREA_DISK, AREA_RECTANGLE, AreaLight};

/// The rays whose direction meets the front of a flat light's plane, and the distances at which they do.
#[inline(always)]
fn plane_hits<S: Simd>(
    light: &AreaLight,
    origin: Vec3x16<S>,
    direction: Vec3x16<S>,
) -> (mask32x16<S>, f32x16<S>, Vec3x16<S>) {
    let simd = origin.0[0].simd;
    let (axis, position) = (Vec3x16::splat(simd, light.axis), Vec3x16::splat(simd, light.position));
    let cosine = axis.dot(direction);
    let t = (position - origin).dot(axis) / cosine;
    (cosine.simd_lt(0.0) & t.simd_gt(0.0), t, origin + direction * t - position)
}

#[inline(always)]
fn sphere_hits<S: Simd>(light: &AreaLight, origin: Vec3x16<S>, direction: Vec3x16<S>) -> (mask32x16<S>, f32x16<S>) {
    let to_centre = Vec3x16::splat(origin.0[0].simd, light.position) - origin;
    let along = to_centre.dot(direction);
    let aside = to_centre - direction * along;
    let radius_squared = light.radius * light.radius;
    let squared = radius_squared - aside.dot(aside);
    let is_outside = to_centre.dot(to_centre).simd_gt(radius_squared);
    (is_outside & along.simd_gt(0.0) & squared.simd_ge(0.0), along - squared.sqrt())
}

/// Returns the rays that meet an area light between 0 and `t_max`. `direction`: unit vectors.
#[inline(always)]
pub fn meets_light<S: Simd>(
    lights: &[AreaLight],
    origin: Vec3x16<S>,
    direction: Vec3x16<S>,
    t_max: f32x16<S>,
) -> mask32x16<S> {
    let mut meets = mask32x16::splat(t_max.simd, false);
    for light in lights {
        let (is_hit, t) = match light.kind {
            AREA_RECTANGLE => {
                let (is_front, t, from_centre) = plane_hits(light, origin, direction);
                let (edge_u, edge_v) = (light.edge_u, light.edge_v);
                let u = from_centre.dot(Vec3x16::splat(t.simd, edge_u)) / edge_u.dot(edge_u);
                let v = from_centre.dot(Vec3x16::splat(t.simd, edge_v)) / edge_v.dot(edge_v);
                (is_front & u.abs().simd_le(1.0) & v.abs().simd_le(1.0), t)
            }
            AREA_DISK => {
                let (is_front, t, from_centre) = plane_hits(light, origin, direction);
                (is_front & from_centre.dot(from_centre).simd_le(light.radius * light.radius), t)
            }
            _ => sphere_hits(light, origin, direction),
        };
        meets |= is_hit & t.simd_lt(t_max) & t.simd_lt(f32::INFINITY);
    }
    meets
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use fearless_simd::{Level, dispatch};
    use glam::{Vec3, vec3};

    use super::*;
    use crate::{
        accel::kdtree::BuildOptions,
        cpu::{lanes::LANES, soa::RaysSoa},
        layout::{AREA_SPHERE, Frame},
        reference::{chi_square::Uniform, emitters::seen_light, inputs::KernelInputs, search_ray::SearchRay},
        scene::{Light, Scene},
        world::{FlatScene, World},
    };

    /// The box of rays' origins is small, so that many rays meet each light.
    fn light_of(kind: u32) -> Light {
        let radiance = Vec3::ONE;
        match kind {
            AREA_RECTANGLE => {
                Light::Rectangle { position: Vec3::Z, edge_u: 1.5 * Vec3::Y, edge_v: vec3(1.0, 0.0, 0.3), radiance }
            }
            AREA_DISK => Light::Disk { position: Vec3::Y, towards: vec3(0.3, -1.0, 0.1), radius: 0.7, radiance },
            _ => Light::Sphere { position: Vec3::X, radius: 0.5, radiance },
        }
    }

    /// A ray at random. Some rays have axes as directions, start at the light's centre, or start around it and so
    /// behind it.
    fn ray_at_random(i: usize, light: &AreaLight, random: &mut Uniform) -> SearchRay {
        let (origin, direction, t) = (random.point() - 0.5, random.point() - 0.5, random.point().x);
        let direction = if i % 7 == 3 { Vec3::AXES[i % 3] } else { direction.normalize() };
        let origin = match (i % 11, i % 5) {
            (5, _) => light.position,
            (_, 2) => light.position + 2.0 * origin,
            _ => origin,
        };
        let t_max = if i.is_multiple_of(3) { 2.0 * t } else { f32::INFINITY };
        SearchRay { origin, direction, t_min: 0.0, t_max, source_triangle: 0, alpha_seed: 0 }
    }

    #[test]
    fn rays_meet_the_lights_that_the_reference_sees() {
        let mut random = Uniform(3);
        for kinds in [&[AREA_RECTANGLE][..], &[AREA_DISK], &[AREA_SPHERE], &[AREA_SPHERE, AREA_RECTANGLE, AREA_DISK]] {
            let lights = kinds.iter().map(|&kind| light_of(kind)).collect();
            let scene = Scene { lights, ..Scene::empty(Path::new("scene")) };
            let flat = FlatScene::new(&scene).expect("a scene");
            let world = World::of_flat(flat, &BuildOptions::default()).expect("a world");
            let frame = Frame::default();
            let inputs = KernelInputs::new(&world, &frame).of_paths(&[], world.emitters());
            let lights = world.emitters().shapes();
            let mut n_met = 0;
            for group in 0..1000 {
                let rays: [_; LANES] =
                    std::array::from_fn(|lane| ray_at_random(LANES * group + lane, &lights[0], &mut random));
                let mut soa = RaysSoa::default();
                rays.iter().enumerate().for_each(|(lane, ray)| soa.set(lane, ray));
                let found = dispatch!(Level::new(), simd => {
                    let (origin, direction) = (Vec3x16::load(simd, &soa.origin), Vec3x16::load(simd, &soa.direction));
                    meets_light(lights, origin, direction, f32x16::load_array_ref(simd, &soa.t_max)).to_bitmask()
                });
                for (lane, ray) in rays.iter().enumerate() {
                    let seen = seen_light(&inputs, ray.origin, ray.direction, ray.t_max);
                    assert_eq!(found >> lane & 1 == 1, seen.t.is_finite(), "{kinds:?} {ray:?}");
                    n_met += u32::from(seen.t.is_finite());
                }
            }
            assert!((500..12_000).contains(&n_met), "{kinds:?}: {n_met} of 16,000");
        }
    }
}
