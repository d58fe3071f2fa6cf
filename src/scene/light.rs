//! Lights.

use glam::Vec3;

/// A source of light that no ray can hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// A point, whose irradiance falls with the square of the distance.
    Point {
        /// World space.
        position: Vec3,
        /// Power per steradian, linear RGB.
        intensity: Vec3,
    },
    /// A light from so far away that it comes from the same direction everywhere.
    Directional {
        /// Unit vector towards the light, world space.
        towards: Vec3,
        /// Irradiance on a surface that faces the light, linear RGB.
        irradiance: Vec3,
    },
}

impl Light {
    /// Whether the light gives no light.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Point { intensity: power, .. } | Self::Directional { irradiance: power, .. } => *power == Vec3::ZERO,
        }
    }
}
