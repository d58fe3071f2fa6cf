//! Indexed meshes in object space.

use glam::Vec3;
use rayon::prelude::*;

use super::{error::Checked, transform::Transform};

/// Largest absolute value of a world coordinate; a mesh that reaches beyond it is refused. The squared length of a
/// triangle's unnormalized normal, at most (2 sqrt(3) * 1e9)^4 = 1.5e38, must not overflow an f32 (3.4e38).
pub const MAX_COORDINATE: f32 = 1e9;

/// An indexed triangle mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Points in object space.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// One entry per face: unit shading normals at its three corners. If any of the three is zero, the whole face is
    /// shaded with the normal of its plane.
    pub normals: Vec<[Vec3; 3]>,
    /// One entry per face: its slot, which selects one of the instance's materials.
    pub slots: Vec<u32>,
}

impl Mesh {
    /// Adds a face that is shaded with its plane's normal.
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

    /// Adds another mesh. Points at the same place are not merged.
    pub fn append(&mut self, other: Mesh) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.faces.extend(other.faces.iter().map(|face| face.map(|ix| first + ix)));
        self.normals.extend(other.normals);
        self.slots.extend(other.slots);
    }

    /// Returns the positions in world space.
    ///
    /// # Errors
    /// A position is not finite or lies beyond [`MAX_COORDINATE`]. The error is a message for people.
    pub fn placed(&self, transform: &Transform) -> Checked<Vec<Vec3>> {
        let world: Vec<Vec3> = self.positions.par_iter().map(|p| transform.point(*p)).collect();
        let is_inside = |p: &Vec3| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE;
        match world.par_iter().find_first(|p| !is_inside(p)) {
            Some(p) => Err(format!("a vertex lies at {:?} in world space: beyond {MAX_COORDINATE:e}", p.to_array())),
            None => Ok(world),
        }
    }
}
