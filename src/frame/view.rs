//! The views of a picture that a window can show.

use crate::layout;

/// A view: the picture, or an AOV of it in false colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// The picture.
    Picture,
    /// Depth of the first hit: the nearer, the brighter.
    Depth,
    /// The shading normal of the first hit: one colour channel for each axis.
    Normal,
    /// The triangle of the first hit: a colour for each index.
    Id,
    /// Number of entries of the acceleration structure that all rays of the pixel read.
    Cost,
    /// Number of the pixel's rays: primary, secondary and shadow rays.
    Rays,
}

named_enum!(View {
    Picture = "picture",
    Depth = "depth",
    Normal = "normal",
    Id = "triangle id",
    Cost = "traversal cost",
    Rays = "ray count"
});

impl View {
    /// Whether the view depends on the hits of primary rays only, so that no further rays are traced for it.
    pub fn needs_primary_rays_only(self) -> bool {
        matches!(self, Self::Depth | Self::Normal | Self::Id)
    }

    /// Returns the kernels' constant of the view, `VIEW_*`; None for the picture, which needs no such kernel.
    pub(crate) fn constant(self) -> Option<u32> {
        match self {
            Self::Picture => None,
            Self::Depth => Some(layout::VIEW_DEPTH),
            Self::Normal => Some(layout::VIEW_NORMAL),
            Self::Id => Some(layout::VIEW_ID),
            Self::Cost => Some(layout::VIEW_COST),
            Self::Rays => Some(layout::VIEW_RAYS),
        }
    }
}
