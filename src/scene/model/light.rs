//! Point, spot and directional lights, which are not visible themselves; the sun, a visible disk; lights with an area;
//! and ambient light from below.

use glam::Vec3;

use super::Up;

/// Ambient light from below. The irradiance of a surface is blended from that of the sky and that of the ground by the
/// height to which its normal points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Irradiance of surfaces that face down, linear RGB.
    pub ambient: Vec3,
    /// The axis of the world that points up.
    pub up: Up,
}

/// A source of light that is no surface of the scene.
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
    /// A light so far away that its direction is the same everywhere, which is seen as a disk. Only the path tracer
    /// knows the disk; otherwise it is a directional light.
    Sun {
        /// Unit vector towards the disk's centre, world space.
        towards: Vec3,
        /// Irradiance on a surface that faces the light, linear RGB.
        irradiance: Vec3,
        /// Angle between opposite edges of the disk, degrees.
        angle_degrees: f32,
    },
    /// A rectangle that shines to one side. Only the path tracer knows it.
    Rectangle {
        /// Centre in world space.
        position: Vec3,
        /// From the centre to the middle of an edge, world units.
        edge_u: Vec3,
        /// From the centre to the middle of a neighbouring edge, at right angles to `edge_u`. The light shines to the
        /// side of the cross product of `edge_u` and `edge_v`.
        edge_v: Vec3,
        /// Emitted radiance, linear RGB.
        radiance: Vec3,
    },
    /// A disk that shines to one side. Only the path tracer knows it.
    Disk {
        /// Centre in world space.
        position: Vec3,
        /// Unit vector along the axis, to the side to which it shines.
        towards: Vec3,
        /// Radius, world units.
        radius: f32,
        /// Emitted radiance, linear RGB.
        radiance: Vec3,
    },
    /// A sphere that shines outwards. Only the path tracer knows it.
    Sphere {
        /// Centre in world space.
        position: Vec3,
        /// Radius, world units.
        radius: f32,
        /// Emitted radiance, linear RGB.
        radiance: Vec3,
    },
}

impl Light {
    /// Returns where the light is, unless it is infinitely far away.
    pub(crate) fn position(&self) -> Option<Vec3> {
        match *self {
            Self::Point { position, .. }
            | Self::Spot { position, .. }
            | Self::Rectangle { position, .. }
            | Self::Disk { position, .. }
            | Self::Sphere { position, .. } => Some(position),
            Self::Directional { .. } | Self::Sun { .. } => None,
        }
    }

    /// Returns whether the light's power is zero: it is black, or has no area.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Point { intensity: power, .. }
            | Self::Spot { intensity: power, .. }
            | Self::Directional { irradiance: power, .. }
            | Self::Sun { irradiance: power, .. } => *power == Vec3::ZERO,
            Self::Rectangle { edge_u, edge_v, radiance, .. } => {
                *radiance == Vec3::ZERO || !(edge_u.cross(*edge_v).length() > 0.0)
            }
            // The square is what kernels compute with.
            Self::Disk { radius, radiance, .. } | Self::Sphere { radius, radiance, .. } => {
                *radiance == Vec3::ZERO || !(radius * radius > 0.0)
            }
        }
    }

    /// Returns whether the light has an area, so that only the path tracer knows it.
    pub fn has_area(&self) -> bool {
        matches!(self, Self::Rectangle { .. } | Self::Disk { .. } | Self::Sphere { .. })
    }
}
