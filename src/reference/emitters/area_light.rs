//! Rectangles, disks and spheres, which are no part of the acceleration structure. Twin of
//! `emitters/area_light.glsl`.

use glam::{Vec2, Vec3};

use super::{
    disk::{hit_disk, sample_disk},
    light_sample::LightSample,
    rectangle::{flat_pdf, hit_rectangle, rectangle_pdf, sample_rectangle},
    sphere::{hit_sphere, sample_sphere, sphere_pdf},
    tree::tree_probability,
};
use crate::{
    layout::{AREA_DISK, AREA_RECTANGLE, AreaLight},
    reference::inputs::KernelInputs,
};

/// What a ray sees of the area lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenLight {
    /// Distance of the nearest one, world units; infinity if the ray meets none.
    pub t: f32,
    /// Radiance that it emits.
    pub radiance: Vec3,
    /// Pdf with which [`sample_light`](super::sample_light) samples the direction, per steradian.
    pub pdf: f32,
}

/// Distance at which a ray meets an area light, world units; infinity if it does not.
fn hit_area_light(light: &AreaLight, origin: Vec3, direction: Vec3) -> f32 {
    match light.kind {
        AREA_RECTANGLE => hit_rectangle(light, origin, direction),
        AREA_DISK => hit_disk(light, origin, direction),
        _ => hit_sphere(light, origin, direction),
    }
}

/// The nearest rectangle, disk or sphere that the ray meets between 0 and `t_max`. `direction`: a unit vector. The
/// backs of rectangles and disks and the insides of spheres are not seen.
pub fn seen_light(inputs: &KernelInputs, origin: Vec3, direction: Vec3, t_max: f32) -> SeenLight {
    let (mut nearest, mut seen) = (f32::INFINITY, None);
    let (shapes, nodes) = inputs.emitters.map_or((&[][..], &[][..]), |it| (it.shapes(), &it.light_nodes));
    for light in shapes {
        let t = hit_area_light(light, origin, direction);
        if t < nearest && t < t_max {
            (nearest, seen) = (t, Some(light));
        }
    }
    let Some(light) = seen else { return SeenLight { t: nearest, radiance: Vec3::ZERO, pdf: 0.0 } };
    let pdf = match light.kind {
        AREA_RECTANGLE => rectangle_pdf(light, origin, direction, nearest),
        AREA_DISK => flat_pdf(light, direction, nearest),
        _ => sphere_pdf(light, origin),
    };
    let probability = light.probability * tree_probability(nodes, origin, light.leaf_ix);
    SeenLight { t: nearest, radiance: light.radiance, pdf: probability * pdf }
}

/// `probability`: with which this light is sampled.
pub(super) fn sample_area_light(light: AreaLight, point_world: Vec3, u: Vec2, probability: f32) -> LightSample {
    let light = AreaLight { probability, ..light };
    match light.kind {
        AREA_RECTANGLE => sample_rectangle(&light, point_world, u),
        AREA_DISK => sample_disk(&light, point_world, u),
        _ => sample_sphere(&light, point_world, u),
    }
}
