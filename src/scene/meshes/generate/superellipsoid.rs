//! Superellipsoids: shapes that range from boxes with rounded edges through ellipsoids to octahedra.

use glam::{DVec3, Vec3};
use serde::Deserialize;

use super::{
    TriangleBudget, length,
    rings::SurfacePoint,
    sphere::{polar_direction, polar_rings},
};
use crate::scene::model::{Mesh, error::Checked, material::within};

/// The surface `(|x|^(2/h) + |z|^(2/h))^(h/v) + |y|^(2/v) = 1`, scaled to its size, around the origin. It is closed
/// and has as many triangles as a sphere with the same parameters. Source: Barr, "Superquadrics and Angle-Preserving
/// Transformations" (1981).
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Superellipsoid {
    /// Extents along x, y, z.
    size: [f32; 3],
    /// The exponents v and h, each from 0.1 (almost a box) to 1.9 (almost an octahedron); 1 and 1 make an ellipsoid.
    exponents: [f32; 2],
    segments: Option<u32>,
    rings: Option<u32>,
    triangles: Option<u32>,
}

impl Superellipsoid {
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        for extent in self.size {
            length("size", extent)?;
        }
        let half = Vec3::from_array(self.size).as_dvec3() / 2.0;
        let [v, h] = self.exponents;
        let shape = Shape {
            v: 2.0 / f64::from(within("exponents", v, 0.1, 1.9)?),
            h: 2.0 / f64::from(within("exponents", h, 0.1, 1.9)?),
        };
        let rings = polar_rings(self.segments, self.rings, self.triangles, budget)?;
        let point = |ring: usize, around: f64| -> SurfacePoint {
            let direction = polar_direction(&rings, ring, around);
            let point = direction / shape.gauge(direction);
            (half * point, (shape.gradient(point) / half).normalize())
        };
        Ok(rings.sweep(point))
    }
}

/// The unscaled solid.
struct Shape {
    /// The power 2/v of the equation, not v itself.
    v: f64,
    /// The power 2/h of the equation, not h itself.
    h: f64,
}

impl Shape {
    /// Returns the number by which a vector from the middle must be divided for its end to be on the surface.
    fn gauge(&self, p: DVec3) -> f64 {
        (self.across(p).powf(self.v) + p.y.abs().powf(self.v)).powf(1.0 / self.v)
    }

    /// Returns the distance from the y axis in the norm of the horizontal section.
    fn across(&self, p: DVec3) -> f64 {
        (p.x.abs().powf(self.h) + p.z.abs().powf(self.h)).powf(1.0 / self.h)
    }

    /// Returns a normal of the surface, of any length.
    fn gradient(&self, p: DVec3) -> DVec3 {
        let across = self.across(p);
        let power = |x: f64, power: f64| x.abs().powf(power - 1.0).copysign(x);
        if across == 0.0 {
            return DVec3::new(0.0, p.y, 0.0);
        }
        let radial = across.powf(self.v - 1.0);
        let horizontal = |x: f64| radial * power(x / across, self.h);
        DVec3::new(horizontal(p.x), power(p.y, self.v), horizontal(p.z))
    }
}
