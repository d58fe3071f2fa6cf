//! Boxes that face outwards or inwards.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::length;
use crate::scene::model::{Mesh, error::Checked};

/// A box centred at the origin: 2 triangles per side, facing outwards. It is closed if no side is left out.
///
/// Side `sides[i]` has slot i.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Edge lengths along x, y, z.
    size: [f32; 3],
    /// Sides of the box; where absent, all six in the order left, right, bottom, top, back, front.
    sides: Option<Vec<Side>>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Side {
    /// The side at -x.
    Left,
    /// The side at +x.
    Right,
    /// The side at -y.
    Bottom,
    /// The side at +y.
    Top,
    /// The side at -z.
    Back,
    /// The side at +z.
    Front,
}

const ALL_SIDES: [Side; 6] = [Side::Left, Side::Right, Side::Bottom, Side::Top, Side::Back, Side::Front];

impl Side {
    /// Returns the numbers of the side's corners, counter-clockwise seen from outside. Bits 0, 1 and 2 of a corner's
    /// number are set at +x, +y and +z.
    fn corners(self) -> [u32; 4] {
        match self {
            Self::Left => [0, 4, 6, 2],
            Self::Right => [5, 1, 3, 7],
            Self::Bottom => [0, 1, 5, 4],
            Self::Top => [6, 7, 3, 2],
            Self::Back => [1, 0, 2, 3],
            Self::Front => [4, 5, 7, 6],
        }
    }
}

impl Cuboid {
    pub fn build(&self) -> Checked<Mesh> {
        self.faces([0, 1, 2, 3], LOWER_LEFT_FIRST)
    }

    /// Makes the inside of the box: its triangles face inwards.
    pub fn room(&self) -> Checked<Mesh> {
        Ok(Mesh { name: "room".to_owned(), ..self.faces([0, 3, 2, 1], LOWER_RIGHT_FIRST)? })
    }

    /// Makes two triangles per side. `order` names the corners of `Side::corners` in the order of the faces, and `uvs`
    /// are their texture coordinates in this order.
    fn faces(&self, order: [usize; 4], uvs: [Vec2; 4]) -> Checked<Mesh> {
        let mut mesh = Mesh { positions: corners(self.size)?, ..Mesh::default() };
        for (slot, side) in self.sides.as_deref().unwrap_or(&ALL_SIDES).iter().enumerate() {
            let corners = order.map(|ix| side.corners()[ix]);
            for face in [[0, 1, 2], [0, 2, 3]] {
                mesh.push_flat(face.map(|ix: usize| corners[ix]), slot as u32);
                mesh.uvs[0].push(face.map(|ix| uvs[ix]));
            }
        }
        Ok(mesh)
    }
}

/// Texture coordinates of a side's corners, counter-clockwise from the lower left corner of the image.
const LOWER_LEFT_FIRST: [Vec2; 4] = [Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO];
/// Texture coordinates of a side's corners, counter-clockwise from the lower right corner of the image.
const LOWER_RIGHT_FIRST: [Vec2; 4] = [Vec2::ONE, Vec2::X, Vec2::ZERO, Vec2::Y];

/// Returns the positions of the eight corners. The index of a corner is its number, as `Side::corners` defines it.
fn corners(size: [f32; 3]) -> Checked<Vec<Vec3>> {
    for edge in size {
        length("size", edge)?;
    }
    let half = Vec3::from_array(size) / 2.0;
    let side = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
    Ok((0..8).map(|n| half * Vec3::new(side(n & 1), side(n & 2), side(n & 4))).collect())
}
