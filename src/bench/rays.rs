//! Sets of rays such as a renderer casts in a scene, from coherent to scattered.

use bytemuck::Zeroable;
use glam::Vec3;
use serde::Serialize;

use super::stage::Stage;
use crate::{
    accel::kdtree::Traversal,
    cast::leaving::{diffuse_rays, leaving, rays_from_hits},
    cpu::trace,
    layout::{Hit, PathRay},
    reference::{light::incident_light, primary_hit::primary_rays, surface::Surface},
};

/// Purpose of the rays of a set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RaySetKind {
    /// Camera rays through the pixels' centres.
    Primary,
    /// Any-hit rays from each primary hit to the light.
    Shadow,
    /// Rays reflected at each primary hit.
    Mirror,
    /// Rays from each primary hit into the hemisphere above it, with a cosine distribution.
    Diffuse,
}

impl RaySetKind {
    /// All kinds, in the order of decreasing coherence.
    pub const ALL: [Self; 4] = [Self::Primary, Self::Shadow, Self::Mirror, Self::Diffuse];

    pub fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Shadow => "shadow",
            Self::Mirror => "mirror",
            Self::Diffuse => "diffuse",
        }
    }

    /// Returns whether such rays search for any hit instead of the closest one.
    pub fn is_any_hit(self) -> bool {
        self == Self::Shadow
    }
}

/// Rays of one kind, in the order of the renderer's queue: square by square, without gaps. They have no source
/// triangle, since rays that leave a surface start at a distance from it.
#[derive(Clone, Debug, PartialEq)]
pub struct RaySet {
    pub kind: RaySetKind,
    pub rays: Vec<PathRay>,
}

/// Returns the four sets, in the order of [`RaySetKind::ALL`]: `width * height` primary rays, and one ray of each other
/// kind for each of their hits. The same stage gives the same rays.
pub fn ray_sets(stage: &Stage) -> [RaySet; 4] {
    let bindings = stage.inputs();
    let mut primary = vec![PathRay::zeroed(); (stage.frame.width * stage.frame.height) as usize];
    primary_rays(&stage.frame, 0, &mut primary);
    let mut hits = vec![Hit::zeroed(); primary.len()];
    trace(&bindings, Traversal::Mask.into(), &primary, &mut hits);

    let triangle_at = |ix| bindings.triangle(ix);
    let shadow = rays_from_hits(triangle_at, &primary, &hits, |ray, surface| {
        let to_light = incident_light(&stage.light, surface.point_world);
        PathRay { t_max: to_light.distance, ..leaving(surface, ray, to_light.direction) }
    });
    let mirror = rays_from_hits(triangle_at, &primary, &hits, |ray, surface| {
        leaving(surface, ray, mirrored(ray.direction, surface))
    });
    let diffuse = diffuse_rays(triangle_at, &primary, &hits);
    let mut sets = RaySetKind::ALL.into_iter().zip([primary, shadow, mirror, diffuse]);
    std::array::from_fn(|_| sets.next().map(|(kind, rays)| RaySet { kind, rays }).expect("as many sets as kinds"))
}

/// Reflects a direction at the shading normal, or at the geometric normal if the former leads into the surface.
fn mirrored(direction: Vec3, surface: &Surface) -> Vec3 {
    let at = |normal: Vec3| (direction - 2.0 * direction.dot(normal) * normal).normalize();
    let smooth = at(surface.shading);
    if smooth.dot(surface.geometric) > 0.0 { smooth } else { at(surface.geometric) }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    fn surface(geometric: Vec3, shading: Vec3) -> Surface {
        Surface {
            point_world: Vec3::ZERO,
            geometric,
            interpolated: shading,
            shading,
            is_reversed: false,
            origin_offset: 0.0,
            from_inside: false,
        }
    }

    #[test]
    fn mirrored_rays_leave_at_the_angle_at_which_they_came() {
        let normal = vec3(0.0, 1.0, 0.0);
        let came = vec3(0.6, -0.8, 0.0);
        assert!((mirrored(came, &surface(normal, normal)) - vec3(0.6, 0.8, 0.0)).length() < 1e-6);
    }

    #[test]
    fn no_mirrored_ray_enters_the_surface() {
        let (geometric, shading) = (Vec3::Y, vec3(0.8, 0.6, 0.0));
        let came = vec3(0.995, -0.0999, 0.0).normalize();
        let at_shading = came - 2.0 * came.dot(shading) * shading;
        assert!(at_shading.y < 0.0, "the example must lead into the surface");
        let found = mirrored(came, &surface(geometric, shading));
        assert!((found - vec3(came.x, -came.y, 0.0)).length() < 1e-6);
    }
}
