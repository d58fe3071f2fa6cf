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
    /// As the kernel knows it.
    pub(crate) fn constant(self) -> u32 {
        match self {
            Self::Picture => layout::VIEW_PICTURE,
            Self::Depth => layout::VIEW_DEPTH,
            Self::Normal => layout::VIEW_NORMAL,
            Self::Id => layout::VIEW_ID,
            Self::Cost => layout::VIEW_COST,
            Self::Rays => layout::VIEW_RAYS,
        }
    }
}
