//! What a window can show of a picture.

use crate::layout;

/// What a window shows of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// The picture.
    Picture,
    /// The nearer, the brighter.
    Depth,
    /// The shading normal, each axis a channel.
    Normal,
    /// Each triangle in a colour of its own.
    Id,
    /// What the pixel's rays, all of them, read of the tree.
    Cost,
    /// The number of the pixel's rays, all of them.
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
    /// Whether the hits of the primary rays alone decide it, so that no further ray is traced for it.
    pub fn needs_primary_rays_only(self) -> bool {
        matches!(self, Self::Depth | Self::Normal | Self::Id)
    }

    /// As the kernel knows it; none for the picture.
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
