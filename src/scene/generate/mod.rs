//! Meshes from a few numbers: what the shipped scenes are made of. One file a family.
//!
//! Closed meshes share the points of their edges bit for bit, and all faces run counter-clockwise seen from outside.
//! Curved surfaces take their normals from the surface, not from the facets.

mod cuboid;
mod lathe;
mod plane;
mod rings;
mod sphere;
mod superellipsoid;
mod torus_knot;

use serde::Deserialize;

use super::{error::Checked, mesh::Mesh};

/// Largest mesh of one generator: 0.8 GB of triangles.
pub const MAX_TRIANGLES: u64 = 1 << 24;

/// `generator = "name"` and its own parameters; no others are accepted.
#[derive(Debug, Deserialize)]
#[serde(tag = "generator", rename_all = "snake_case")]
pub enum Generator {
    Box(cuboid::Cuboid),
    Room(cuboid::Room),
    Plane(plane::Plane),
    Disc(plane::Disc),
    Sphere(sphere::Sphere),
    Geodesic(sphere::Geodesic),
    Superellipsoid(superellipsoid::Superellipsoid),
    TorusKnot(torus_knot::TorusKnot),
    Lathe(lathe::Lathe),
}

impl Generator {
    /// The mesh around the origin. The error says which parameter is out of range.
    pub fn build(&self) -> Checked<Mesh> {
        match self {
            Self::Box(cuboid) => cuboid.build(),
            Self::Room(room) => room.build(),
            Self::Plane(plane) => plane.build(),
            Self::Disc(disc) => disc.build(),
            Self::Sphere(sphere) => sphere.build(),
            Self::Geodesic(geodesic) => geodesic.build(),
            Self::Superellipsoid(superellipsoid) => superellipsoid.build(),
            Self::TorusKnot(knot) => knot.build(),
            Self::Lathe(lathe) => lathe.build(),
        }
    }
}

/// A length above zero.
fn length(name: &str, value: f32) -> Checked<f64> {
    super::material::within(name, value, 1e-6, 1e6).map(f64::from)
}

/// A number of parts.
fn count(name: &str, value: u32, min: u32) -> Checked<u32> {
    const MAX: u32 = 1 << 16;
    if (min..=MAX).contains(&value) { Ok(value) } else { Err(format!("{name} = {value} is outside {min} to {MAX}")) }
}

/// A number of triangles that one mesh may have.
fn triangle_budget(n_triangles: u64) -> Checked<()> {
    if n_triangles <= MAX_TRIANGLES {
        Ok(())
    } else {
        Err(format!("makes {n_triangles} triangles: more than {MAX_TRIANGLES}"))
    }
}
