//! What a window can show of a picture.

use crate::layout;

/// What a window shows of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    Picture,
    /// The nearer, the brighter.
    Depth,
    /// The shading normal, each axis a channel.
    Normal,
    /// Each triangle in a colour of its own.
    Id,
    /// What the pixel's rays read of the tree.
    Cost,
    /// The pixel's rays.
    Rays,
}

words!(View {
    Picture = "picture",
    Depth = "depth",
    Normal = "normal",
    Id = "triangle id",
    Cost = "traversal cost",
    Rays = "ray count"
});

impl View {
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
