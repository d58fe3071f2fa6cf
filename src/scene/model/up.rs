//! The axis that points up.

use glam::Vec3;

/// The axis of the world that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// +y.
    #[default]
    Y,
    /// +z.
    Z,
}

named_enum!(Up {
    Y = "y": "+y, as in glTF and in most OBJ and PLY files",
    Z = "z": "+z, as in most STL files, in CAD, in maps and in Blender",
});

impl Up {
    /// Returns the unit vector.
    pub fn vector(self) -> Vec3 {
        match self {
            Self::Y => Vec3::Y,
            Self::Z => Vec3::Z,
        }
    }
}
