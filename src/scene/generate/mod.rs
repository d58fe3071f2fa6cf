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

use super::{error::Checked, mesh::Mesh, needs};

/// Largest mesh of one generator: 0.8 GB of triangles.
pub const MAX_TRIANGLES: u64 = 1 << 24;
/// Triangles that all generators of a scene may make: 3.2 GB.
pub const MAX_TRIANGLES_OF_SCENE: u64 = 1 << 26;

/// `generator = "name"` and its own parameters; no others are accepted.
#[derive(Debug, Deserialize)]
#[serde(tag = "generator", rename_all = "snake_case")]
pub enum Generator {
    /// A box.
    Box(cuboid::Cuboid),
    /// A box whose faces look inwards, with a material for each wall.
    Room(cuboid::Room),
    /// A rectangle, which may be checkered.
    Plane(plane::Plane),
    /// A disc.
    Disc(plane::Disc),
    /// A sphere of rings and segments.
    Sphere(sphere::Sphere),
    /// A sphere of about equal triangles.
    Geodesic(sphere::Geodesic),
    /// A shape between box, sphere and octahedron.
    Superellipsoid(superellipsoid::Superellipsoid),
    /// A tube around a torus knot.
    TorusKnot(torus_knot::TorusKnot),
    /// A profile that turns around an axis.
    Lathe(lathe::Lathe),
}

impl Generator {
    /// The mesh around the origin. The error says which parameter is out of range, or that the mesh is too large for
    /// the `budget`.
    pub fn build(&self, budget: &Budget) -> Checked<Mesh> {
        match self {
            Self::Box(cuboid) => cuboid.build(),
            Self::Room(room) => room.build(),
            Self::Plane(plane) => plane.build(budget),
            Self::Disc(disc) => disc.build(budget),
            Self::Sphere(sphere) => sphere.build(budget),
            Self::Geodesic(geodesic) => geodesic.build(budget),
            Self::Superellipsoid(superellipsoid) => superellipsoid.build(budget),
            Self::TorusKnot(knot) => knot.build(budget),
            Self::Lathe(lathe) => lathe.build(budget),
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

/// What a scene holds already, which limits what its next generator may make.
#[derive(Clone, Copy, Debug, Default)]
pub struct Budget {
    /// Triangles that generators have made.
    pub n_generated: u64,
    /// All triangles, those from files included.
    pub n_triangles: u64,
}

impl Budget {
    /// Refuses a mesh of more triangles than a mesh or a scene may have, or than fit in memory.
    fn require(&self, n_triangles: u64) -> Checked<()> {
        if n_triangles > MAX_TRIANGLES {
            return Err(format!("makes {n_triangles} triangles: more than {MAX_TRIANGLES}"));
        }
        let n_generated = self.n_generated + n_triangles;
        if n_generated > MAX_TRIANGLES_OF_SCENE {
            return Err(format!(
                "makes {n_triangles} triangles, with those of the generators before it {n_generated}: a scene may have \
                 {MAX_TRIANGLES_OF_SCENE} from generators"
            ));
        }
        needs::require_for_triangles(self.n_triangles, n_triangles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generators_of_a_scene_are_limited_together() {
        let after = |n_generated: u64| Budget { n_generated, n_triangles: 0 };
        after(0).require(12).unwrap();
        assert!(after(0).require(MAX_TRIANGLES + 1).unwrap_err().contains("more than 16777216"));
        after(MAX_TRIANGLES_OF_SCENE - 12).require(12).unwrap();
        let error = after(MAX_TRIANGLES_OF_SCENE - 12).require(13).unwrap_err();
        assert!(error.contains("67108865") && error.contains("67108864"), "{error}");
    }
}
