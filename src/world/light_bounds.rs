//! What lights send where, as the light tree sees it: where they are, in which directions they shine, and how much.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use super::emitters::luminance;
use crate::layout::{AREA_SPHERE, AreaLight, LIGHT_SPOT, Light, Triangle};

/// The angle by which the cone of a spot light is wider than the light, against rounding, radians.
const SPOT_MARGIN: f32 = 1.0e-3;

/// Directions in which lights shine: those within `end` of an axis in a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Unit vector in the cone's middle.
    pub axis: Vec3,
    /// Angle between the middle and the axes of the lights, radians. Pi: all directions.
    pub spread: f32,
    /// Greatest angle to its axis at which a light shines, radians.
    pub end: f32,
    /// Whether the opposite directions belong to it. The spread is then at most a right angle.
    pub is_two_sided: bool,
}

impl Cone {
    /// All directions.
    pub const ALL: Self = Self { axis: Vec3::Z, spread: PI, end: FRAC_PI_2, is_two_sided: false };

    /// Returns the directions of a light with one axis.
    pub fn around(axis: Vec3, end: f32, is_two_sided: bool) -> Self {
        Self { axis, spread: 0.0, end, is_two_sided }
    }

    /// Returns a cone that holds both.
    fn union(self, other: Self) -> Self {
        let (wide, narrow) = if self.spread >= other.spread { (self, other) } else { (other, self) };
        let (end, is_two_sided) = (wide.end.max(narrow.end), wide.is_two_sided || narrow.is_two_sided);
        let limit = if is_two_sided { FRAC_PI_2 } else { PI };
        let is_opposite = is_two_sided && wide.axis.dot(narrow.axis) < 0.0;
        let other_axis = if is_opposite { -narrow.axis } else { narrow.axis };
        let turn_axis = wide.axis.cross(other_axis);
        let between = turn_axis.length().atan2(wide.axis.dot(other_axis));
        let spread = wide.spread.max((wide.spread + between + narrow.spread) / 2.0);
        if spread >= limit {
            return Self { end, ..Self::ALL };
        }
        let turn_axis = turn_axis.try_normalize().unwrap_or_else(|| wide.axis.any_orthonormal_vector());
        let axis = Quat::from_axis_angle(turn_axis, spread - wide.spread) * wide.axis;
        Self { axis: axis.normalize(), spread, end, is_two_sided }
    }

    /// Returns the solid angle in which the lights shine, by which splits are compared. Directions outside of the cone
    /// of the lights' axes are weighted by the cosine of their angle to it.
    fn measure(self) -> f32 {
        let (spread, end) = (self.spread, (self.spread + self.end).min(PI));
        let (sine, cosine) = spread.sin_cos();
        let beyond = 2.0 * end * sine - (spread - 2.0 * end).cos() - 2.0 * spread * sine + cosine;
        2.0 * PI * (1.0 - cosine) + FRAC_PI_2 * beyond
    }
}

/// What one or more lights send where.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightBounds {
    /// Corners of the box that holds the lights, world space.
    pub min: Vec3,
    pub max: Vec3,
    pub cone: Cone,
    /// Sum of what the lights emit along their axes.
    pub intensity: f64,
}

impl LightBounds {
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            cone: self.cone.union(other.cone),
            intensity: self.intensity + other.intensity,
        }
    }

    pub fn centre(&self) -> Vec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// Returns the cost of a node: what it emits, by its size and by its directions. Unlike the surface of its box, the
    /// square of the diagonal tells lights in a row apart.
    pub fn cost(&self) -> f64 {
        self.intensity * (self.max - self.min).as_dvec3().length_squared() * f64::from(self.cone.measure())
    }
}

impl LightBounds {
    /// Returns the bounds of a point light or a spot light.
    pub fn of_light(light: &Light) -> Self {
        let cone = if light.kind == LIGHT_SPOT && light.outer_cos > 0.0 {
            Cone::around(light.axis, (light.outer_cos.acos() + SPOT_MARGIN).min(FRAC_PI_2), false)
        } else {
            Cone::ALL
        };
        // The radiant intensity of the physical light is pi times that of the scene file's.
        let intensity = std::f64::consts::PI * luminance(light.intensity);
        Self { min: light.position, max: light.position, cone, intensity }
    }

    /// Returns the bounds of a rectangle, a disk or a sphere.
    pub fn of_area_light(light: &AreaLight) -> Self {
        let (half, cone, seen_area) = if light.kind == AREA_SPHERE {
            (Vec3::splat(light.radius), Cone::ALL, light.area / 4.0)
        } else {
            // A disk fits into the square around it.
            let scale = if light.radius > 0.0 { light.radius } else { 1.0 };
            let half = scale * (light.edge_u.abs() + light.edge_v.abs());
            (half, Cone::around(light.axis, FRAC_PI_2, false), light.area)
        };
        let intensity = f64::from(seen_area) * luminance(light.radiance);
        Self { min: light.position - half, max: light.position + half, cone, intensity }
    }

    /// Returns the bounds of a triangle that emits to both sides. `intensity`: along its normal.
    pub fn of_triangle(t: &Triangle, intensity: f64) -> Self {
        let normal = (t.v1 - t.v0).as_dvec3().cross((t.v2 - t.v0).as_dvec3()).normalize_or(glam::DVec3::Z);
        Self {
            min: t.v0.min(t.v1).min(t.v2),
            max: t.v0.max(t.v1).max(t.v2),
            cone: Cone::around(normal.as_vec3(), FRAC_PI_2, true),
            intensity,
        }
    }
}
