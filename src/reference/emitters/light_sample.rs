//! What [`sample_light`](super::sample_light) returns, whichever kind of emitter was sampled. Twin of
//! `emitters/light_sample.glsl`.

use glam::Vec3;

use crate::reference::turns::sin_cos_of_turns;

/// A number beyond which a pdf or a weight counts as infinite.
pub(super) const MOST_LIGHT: f32 = 1.0e30;

/// A direction from which light may come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector from the point.
    pub direction: Vec3,
    /// Distance up to which the way must be free, world units (infinity for what is beyond the scene).
    pub distance: f32,
    /// Radiance divided by `pdf`. Of lights without a size: irradiance on a facing surface, divided by the
    /// probability of the sample. Either is multiplied by f |cos| to give the reflected radiance. 0: there is no light.
    pub light: Vec3,
    /// Pdf of the direction, per steradian, the probability of the emitter included. It is 0 for lights without a
    /// size, which no ray can hit.
    pub pdf: f32,
}

impl LightSample {
    /// The sample where there is no light.
    pub const NONE: Self = Self { direction: Vec3::ZERO, distance: 0.0, light: Vec3::ZERO, pdf: 0.0 };
}

/// Unit vector and distance to a point; the distance is 0 if there is no direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Towards {
    pub direction: Vec3,
    pub distance: f32,
}

pub(super) fn towards(from: Vec3, to: Vec3) -> Towards {
    let way = to - from;
    let distance = way.dot(way).sqrt();
    // Not `<=`: a NaN has no direction.
    if !(distance > 0.0) {
        return Towards { direction: Vec3::ZERO, distance: 0.0 };
    }
    Towards { direction: way / distance, distance }
}

/// The sample of a point from which light of this radiance comes.
pub(super) fn sample_of_point(way: Towards, radiance: Vec3, pdf: f32) -> LightSample {
    if !(pdf > 0.0 && pdf < MOST_LIGHT) {
        return LightSample::NONE;
    }
    LightSample { direction: way.direction, distance: way.distance, light: radiance / pdf, pdf }
}

/// A vector that is `cosine` along the first of three orthonormal axes, and `sine` aside of it at an azimuth in turns.
pub(super) fn around([axis, aside_u, aside_v]: [Vec3; 3], [cosine, sine, turns]: [f32; 3]) -> Vec3 {
    let (along_v, along_u) = sin_cos_of_turns(turns);
    cosine * axis + sine * (along_u * aside_u + along_v * aside_v)
}
