//! Lights, which illuminate surfaces but are not visible themselves.

use glam::Vec3;

use super::look::Up;

/// Ambient light from below. The irradiance of a surface is blended from that of the sky and that of the ground by the
/// height to which its normal points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Irradiance of surfaces that face down, linear RGB.
    pub ambient: Vec3,
    /// The axis of the world that points up.
    pub up: Up,
}

/// A source of light that no ray can hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// A point light, whose irradiance falls with the square of the distance.
    Point {
        /// Position in world space.
        position: Vec3,
        /// Radiant intensity (power per steradian), linear RGB.
        intensity: Vec3,
    },
    /// A point light that shines into a cone.
    Spot {
        /// Position in world space.
        position: Vec3,
        /// Unit vector along which it shines, the axis of the cone, world space.
        towards: Vec3,
        /// Radiant intensity along the axis (power per steradian), linear RGB.
        intensity: Vec3,
        /// Cosine of the angle between the axis and a direction up to which the intensity is whole.
        inner_cos: f32,
        /// Cosine of the angle beyond which the light is dark, at most `inner_cos`.
        outer_cos: f32,
    },
    /// A light so far away that its direction is the same everywhere.
    Directional {
        /// Unit vector towards the light, world space.
        towards: Vec3,
        /// Irradiance on a surface that faces the light, linear RGB.
        irradiance: Vec3,
    },
}

impl Light {
    /// Returns whether the light's power is zero.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Point { intensity: power, .. }
            | Self::Spot { intensity: power, .. }
            | Self::Directional { irradiance: power, .. } => *power == Vec3::ZERO,
        }
    }
}
