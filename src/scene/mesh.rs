//! Indexed meshes in object space.

use glam::Vec3;
use rayon::prelude::*;

use super::{error::Checked, transform::Transform};

/// World coordinates beyond this are refused: the squared length of a triangle's unnormalized normal, at most
/// (2 sqrt(3) * 1e9)^4 = 1.5e38, must not overflow an f32 (3.4e38).
pub const MAX_COORDINATE: f32 = 1e9;

/// Triangles that share points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Object space.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// One entry a face: unit shading normals at its corners, zero for the face's own plane.
    pub normals: Vec<[Vec3; 3]>,
    /// One entry a face: which of the instance's materials it has.
    pub slots: Vec<u32>,
}

impl Mesh {
    /// Adds a face of slot `slot` that is shaded as the plane it is.
    pub fn push_flat(&mut self, face: [u32; 3], slot: u32) {
        self.faces.push(face);
        self.normals.push([Vec3::ZERO; 3]);
        self.slots.push(slot);
    }

    /// Adds a point and returns its index.
    pub fn push_position(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        (self.positions.len() - 1) as u32
    }

    /// Adds another mesh, without joining any points.
    pub fn append(&mut self, other: Mesh) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.faces.extend(other.faces.iter().map(|face| face.map(|ix| first + ix)));
        self.normals.extend(other.normals);
        self.slots.extend(other.slots);
    }

    /// The positions as they are placed in the world. All of them are finite and lie within [`MAX_COORDINATE`].
    ///
    /// # Errors
    /// A position that is not, in words.
    pub fn placed(&self, transform: &Transform) -> Checked<Vec<Vec3>> {
        let world: Vec<Vec3> = self.positions.par_iter().map(|p| transform.point(*p)).collect();
        let is_inside = |p: &Vec3| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE;
        match world.par_iter().find_first(|p| !is_inside(p)) {
            Some(p) => Err(format!("a vertex lies at {:?} in world space: beyond {MAX_COORDINATE:e}", p.to_array())),
            None => Ok(world),
        }
    }
}
