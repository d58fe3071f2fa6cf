//! Boxes from outside and from inside.

use glam::Vec3;
use serde::Deserialize;

use super::length;
use crate::scene::{error::Checked, mesh::Mesh};

/// A box centred at the origin: 12 triangles, closed.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Edge lengths along x, y, z.
    size: [f32; 3],
}

/// The inside of a box centred at the origin: 2 triangles a wall, facing inwards.
///
/// Slot i is `walls[i]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Room {
    /// Edge lengths along x, y, z.
    size: [f32; 3],
    /// Which walls there are; all six where absent.
    walls: Option<Vec<Wall>>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Wall {
    /// -x
    Left,
    /// +x
    Right,
    /// -y
    Floor,
    /// +y
    Ceiling,
    /// -z
    Back,
    /// +z
    Front,
}

const ALL_WALLS: [Wall; 6] = [Wall::Left, Wall::Right, Wall::Floor, Wall::Ceiling, Wall::Back, Wall::Front];

impl Wall {
    /// Corner numbers counter-clockwise seen from outside; bit 0, 1, 2 of a number: at +x, +y, +z.
    fn corners(self) -> [u32; 4] {
        match self {
            Self::Left => [0, 4, 6, 2],
            Self::Right => [5, 1, 3, 7],
            Self::Floor => [0, 1, 5, 4],
            Self::Ceiling => [6, 7, 3, 2],
            Self::Back => [1, 0, 2, 3],
            Self::Front => [4, 5, 7, 6],
        }
    }
}

impl Cuboid {
    pub fn build(&self) -> Checked<Mesh> {
        let mut mesh = Mesh { positions: corners(self.size)?, ..Mesh::default() };
        for [a, b, c, d] in ALL_WALLS.map(Wall::corners) {
            mesh.push_flat([a, b, c], 0);
            mesh.push_flat([a, c, d], 0);
        }
        Ok(mesh)
    }
}

impl Room {
    pub fn build(&self) -> Checked<Mesh> {
        let mut mesh = Mesh { positions: corners(self.size)?, ..Mesh::default() };
        let walls = self.walls.as_deref().unwrap_or(&ALL_WALLS);
        for (slot, [a, b, c, d]) in walls.iter().map(|wall| wall.corners()).enumerate() {
            mesh.push_flat([a, c, b], slot as u32);
            mesh.push_flat([a, d, c], slot as u32);
        }
        Ok(mesh)
    }
}

/// The eight corners, by the bits of their numbers.
fn corners(size: [f32; 3]) -> Checked<Vec<Vec3>> {
    for edge in size {
        length("size", edge)?;
    }
    let half = Vec3::from_array(size) / 2.0;
    let side = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
    Ok((0..8).map(|n| half * Vec3::new(side(n & 1), side(n & 2), side(n & 4))).collect())
}
