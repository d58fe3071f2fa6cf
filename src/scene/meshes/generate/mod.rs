//! Generators, which make meshes from a few parameters. The shipped scenes are made of such meshes. Each family of
//! shapes has its own file.
//!
//! In closed meshes, faces that meet share their points bit for bit, and all faces are counter-clockwise seen from
//! outside. Curved surfaces have the normals of the exact surface, not of the facets.

mod cuboid;
mod lathe;
mod plane;
mod rings;
mod sphere;
mod superellipsoid;
mod torus_knot;

use serde::Deserialize;

pub(crate) use self::plane::Disc;
use super::needs::{Attributes, MeshSize, require_for_mesh};
use crate::scene::model::{Mesh, error::Checked};

/// Largest number of triangles of one generator's mesh: 1.4 GiB at 88 bytes each.
pub const MAX_TRIANGLES: u64 = 1 << 24;
/// Largest number of triangles that all generators of a scene may make together: 5.5 GiB at 88 bytes each.
pub const MAX_TRIANGLES_OF_SCENE: u64 = 1 << 26;

/// A generator, selected by `generator = "name"`, with its own parameters. Other parameters are an error.
#[derive(Debug, Deserialize)]
#[serde(tag = "generator", rename_all = "snake_case")]
pub enum Generator {
    /// A box.
    Box(cuboid::Cuboid),
    /// A box whose faces point inwards, with a slot for each wall.
    Room(cuboid::Cuboid),
    /// A rectangle, which may be checkered.
    Plane(plane::Plane),
    /// A disc.
    Disc(plane::Disc),
    /// A sphere of rings and segments.
    Sphere(sphere::Sphere),
    /// A sphere of triangles of about equal size.
    Geodesic(sphere::Geodesic),
    /// A shape between a box, a sphere and an octahedron.
    Superellipsoid(superellipsoid::Superellipsoid),
    /// A tube around a torus knot.
    TorusKnot(torus_knot::TorusKnot),
    /// A surface of revolution.
    Lathe(lathe::Lathe),
}

impl Generator {
    /// Makes the mesh, around the origin. The error says which parameter is out of range, or that the mesh is too
    /// large for the `budget`.
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        match self {
            Self::Box(cuboid) => cuboid.build(),
            Self::Room(cuboid) => cuboid.room(),
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

/// Checks a length, which is 1e-6 to 1e6.
fn length(name: &str, value: f32) -> Checked<f64> {
    crate::scene::model::material::within(name, value, 1e-6, 1e6).map(f64::from)
}

/// Checks a number of parts, which is `min` to 2^16.
fn count(name: &str, value: u32, min: u32) -> Checked<u32> {
    const MAX: u32 = 1 << 16;
    if (min..=MAX).contains(&value) { Ok(value) } else { Err(format!("{name} = {value} is outside {min} to {MAX}")) }
}

/// Numbers of triangles that a scene has already. What they leave of the scene's limits is the budget of its next
/// generator.
#[derive(Clone, Copy, Debug, Default)]
pub struct TriangleBudget {
    /// Number of triangles that generators have made.
    pub n_generated: u64,
    /// Number of all triangles, including those from files.
    pub n_triangles: u64,
}

impl TriangleBudget {
    /// Refuses a mesh whose number of triangles exceeds the limit of a mesh or of a scene, or the memory.
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
        // Most meshes have one point for two triangles, and some have one for each.
        let attributes = Attributes { n_uv_sets: 1, ..Attributes::default() };
        require_for_mesh(self.n_triangles, &MeshSize { n_triangles, n_points: n_triangles, attributes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generators_of_a_scene_are_limited_together() {
        let after = |n_generated: u64| TriangleBudget { n_generated, n_triangles: 0 };
        after(0).require(12).unwrap();
        assert!(after(0).require(MAX_TRIANGLES + 1).unwrap_err().contains("more than 16777216"));
        after(MAX_TRIANGLES_OF_SCENE - 12).require(12).unwrap();
        let error = after(MAX_TRIANGLES_OF_SCENE - 12).require(13).unwrap_err();
        assert!(error.contains("67108865") && error.contains("67108864"), "{error}");
    }
}
