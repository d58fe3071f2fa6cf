//! Tubes along torus knots, with optional ripples.

use std::f64::consts::TAU;

use glam::DVec3;
use serde::Deserialize;

use super::{
    TriangleBudget, count, length,
    rings::{Rings, heading, normal_at},
};
use crate::scene::model::{Mesh, error::Checked, material::within};

/// A closed tube along a knot that runs `p` times around the y axis and `q` times around a circle about that axis. It
/// has 2 * segments * sides triangles, or exactly `triangles` (even) on `segments` rings.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorusKnot {
    p: u32,
    q: u32,
    /// Radius of the circle.
    radius: f32,
    /// Distance of the tube's centre line from the circle.
    swing: f32,
    /// Radius of the tube.
    tube: f32,
    segments: u32,
    sides: Option<u32>,
    triangles: Option<u32>,
    /// Numbers of waves along the knot and around the tube. If both are not 0, the ripples wind around the tube.
    ripples: Option<[i32; 2]>,
    /// Amplitude of the waves as a fraction of the tube's radius, 0 to 0.9; 0 where absent.
    ripple_depth: Option<f32>,
}

/// The checked parameters of a `TorusKnot`.
struct Tube {
    p: f64,
    q: f64,
    radius: f64,
    swing: f64,
    tube: f64,
    ripples: [f64; 2],
    ripple_depth: f64,
}

impl TorusKnot {
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        let tube = self.tube()?;
        let rings = self.rings(budget)?;
        let n_rings = rings.n_points.len() as f64;
        let position = |along, around| tube.position(along, around);
        Ok(rings.sweep(|ring, around| {
            let along = ring as f64 / n_rings;
            (position(along, around), normal_at(position, along, around))
        }))
    }

    fn rings(&self, budget: &TriangleBudget) -> Checked<Rings> {
        let segments = count("segments", self.segments, 3)?;
        match (self.sides, self.triangles) {
            (Some(sides), None) => {
                let sides = count("sides", sides, 3)?;
                budget.require(2 * u64::from(segments) * u64::from(sides))?;
                Ok(Rings { n_points: vec![sides; segments as usize], cyclic: true })
            }
            (None, Some(triangles)) => {
                budget.require(u64::from(triangles))?;
                Rings::cyclic(triangles, segments)
            }
            _ => Err("needs either `sides` or `triangles`".to_owned()),
        }
    }

    fn tube(&self) -> Checked<Tube> {
        let (p, q) = (count("p", self.p, 1)?, count("q", self.q, 1)?);
        if gcd(p, q) != 1 {
            return Err(format!("p = {p} and q = {q} have a common factor: the knot would cover itself"));
        }
        Ok(Tube {
            p: f64::from(p),
            q: f64::from(q),
            radius: length("radius", self.radius)?,
            swing: length("swing", self.swing)?,
            tube: length("tube", self.tube)?,
            ripples: self.ripples.unwrap_or_default().map(f64::from),
            ripple_depth: f64::from(within("ripple_depth", self.ripple_depth.unwrap_or(0.0), 0.0, 0.9)?),
        })
    }
}

impl Tube {
    /// Returns the point at the positions `along` the knot and `around` the tube, each 0 to 1.
    fn position(&self, along: f64, around: f64) -> DVec3 {
        let (sin_q, cos_q) = (self.q * along * TAU).sin_cos();
        let outward = heading(self.p * along);
        let forward = DVec3::new(outward.z, 0.0, -outward.x);
        let from_axis = self.radius + self.swing * cos_q;
        let middle = from_axis * outward + self.swing * sin_q * DVec3::Y;
        // The knot lies on a torus, so the torus's normal is perpendicular to the knot and is the same at both ends.
        let normal = cos_q * outward + sin_q * DVec3::Y;
        let tangent = self.swing * self.q * (cos_q * DVec3::Y - sin_q * outward) + from_axis * self.p * forward;
        let beside = normal.cross(tangent.normalize());
        let [waves_along, waves_around] = self.ripples;
        let wave = (TAU * (waves_along * along + waves_around * around)).cos();
        let (sin, cos) = (TAU * around).sin_cos();
        middle + self.tube * (1.0 + self.ripple_depth * wave) * (cos * normal + sin * beside)
    }
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}
