//! Lights, which illuminate surfaces but are not visible themselves.

use glam::Vec3;

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
    /// A point light that shines in a cone.
    Spot {
        /// Position in world space.
        position: Vec3,
        /// Unit vector along the axis of the cone, from the light, world space.
        towards: Vec3,
        /// Radiant intensity on the axis (power per steradian), linear RGB.
        intensity: Vec3,
        /// Cosine of the angle from the axis at which the intensity begins to fall.
        inner_cos: f32,
        /// Cosine of the angle from the axis from which on there is no light.
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
