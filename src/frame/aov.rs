//! What a pixel shows beside its colour (AOVs: arbitrary output variables), by the names that users know.

use crate::layout::Feature;

/// One output. World space and units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aov {
    /// Distance from the eye along the camera's view; infinity where nothing is.
    Depth,
    /// The shading normal, unit length, towards the eye; 0 where nothing is.
    Normal,
    /// The point that is seen; 0 where nothing is.
    Position,
    /// Kd of what is seen, linear.
    Albedo,
    /// The triangle's number in the scene's order; 4294967295 where nothing is.
    Id,
    /// Its material's number; 4294967295 where nothing is.
    Material,
    /// Rays that the pixel took: primary, secondary and shadow rays.
    Rays,
    /// What they read of the tree: nodes, and leaves' triangles.
    Cost,
}

named_enum!(Aov {
    Depth = "depth",
    Normal = "normal",
    Position = "position",
    Albedo = "albedo",
    Id = "id",
    Material = "material",
    Rays = "rays",
    Cost = "cost"
});

/// A named number of each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Layer, dot, component.
    pub name: String,
    /// The samples of all pixels, rows from the top.
    pub samples: Samples,
}

/// One a pixel.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Single-precision numbers.
    Float(Vec<f32>),
    /// Counts and indices.
    Uint(Vec<u32>),
}

impl Aov {
    /// Its channels, from a picture's features.
    pub fn channels(self, features: &[Feature]) -> Vec<Channel> {
        let float = |component: &str, value: fn(&Feature) -> f32| Channel {
            name: format!("{self}.{component}"),
            samples: Samples::Float(features.iter().map(value).collect()),
        };
        let uint = |component: &str, value: fn(&Feature) -> u32| Channel {
            name: format!("{self}.{component}"),
            samples: Samples::Uint(features.iter().map(value).collect()),
        };
        match self {
            Self::Depth => vec![float("Z", |f| f.depth)],
            Self::Normal => vec![
                float("X", |f| f.normal_world.x),
                float("Y", |f| f.normal_world.y),
                float("Z", |f| f.normal_world.z),
            ],
            Self::Position => vec![
                float("X", |f| f.position_world.x),
                float("Y", |f| f.position_world.y),
                float("Z", |f| f.position_world.z),
            ],
            Self::Albedo => {
                vec![float("R", |f| f.albedo.x), float("G", |f| f.albedo.y), float("B", |f| f.albedo.z)]
            }
            Self::Id => vec![uint("ID", |f| f.triangle_ix)],
            Self::Material => vec![uint("ID", |f| f.material_ix)],
            Self::Rays => vec![uint("N", |f| f.n_rays)],
            Self::Cost => vec![uint("N", |f| f.n_steps)],
        }
    }
}
