//! Directional lights that are seen as disks: parts of the environment. Twin of `emitters/sun.glsl`.

use glam::{Vec2, Vec3};

use super::light_sample::around;
use crate::{layout::AreaLight, world::Emitters};

/// What the suns add to the environment in a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct SeenSuns {
    pub radiance: Vec3,
    /// The suns' part of the pdf with which the direction is sampled, per steradian.
    pub pdf: f32,
}

pub(super) fn seen_suns(emitters: &Emitters, direction: Vec3) -> SeenSuns {
    let mut seen = SeenSuns { radiance: Vec3::ZERO, pdf: 0.0 };
    for sun in emitters.suns() {
        // The squared distance of two unit vectors is twice 1 - cos. It keeps small angles exact.
        let aside = direction - sun.position;
        if aside.dot(aside) > 2.0 * sun.radius {
            continue;
        }
        seen.radiance += sun.radiance;
        seen.pdf += sun.probability / sun.area;
    }
    seen
}

/// A direction, uniform in the disk of a sun.
pub(super) fn sun_direction(sun: &AreaLight, u: Vec2) -> Vec3 {
    let versine = u.x * sun.radius;
    let sine = (versine * (2.0 - versine)).sqrt();
    around([sun.position, sun.edge_u, sun.edge_v], [1.0 - versine, sine, u.y])
}
