//! The ways of rays through a kd-tree.

use crate::layout;

/// How a ray finds its way through the kd-tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversal {
    /// A bit a level says which siblings are still to be visited, and what waits there has its place in local memory.
    Mask,
    /// The paper's own: a bit a level says which siblings are done; their boxes tell whether to visit them.
    MaskBoxes,
    /// Every subtree that was left is found again from the root.
    Restart,
    /// Back to the deepest ancestor that the ray has not left, by its box.
    Backtrack,
    /// The eight newest far children; older ones by a restart.
    ShortStack,
    /// From leaf to leaf, by links to its neighbours.
    Ropes,
    /// An array of far children. On the CPU, sixteen rays go together.
    Stack,
    /// No tree: every triangle. For small meshes.
    Brute,
}

impl Traversal {
    /// The paper's idea; a stack and ropes are up to a tenth faster on some scenes (README.md's figures).
    pub const OF_GPUS: Self = Self::Mask;
    /// What is fastest where drivers run kernels on the CPU.
    pub const OF_SOFTWARE_DRIVERS: Self = Self::Ropes;
    /// What is fastest on the CPU itself.
    pub const OF_CPU: Self = Self::Stack;

    /// The kernels' specialization constant.
    pub(crate) fn constant(self) -> u32 {
        match self {
            Self::Mask => layout::TRAVERSAL_MASK,
            Self::MaskBoxes => layout::TRAVERSAL_MASK_BOXES,
            Self::Restart => layout::TRAVERSAL_RESTART,
            Self::Backtrack => layout::TRAVERSAL_BACKTRACK,
            Self::ShortStack => layout::TRAVERSAL_SHORT_STACK,
            Self::Ropes => layout::TRAVERSAL_ROPES,
            Self::Stack => layout::TRAVERSAL_STACK,
            Self::Brute => layout::TRAVERSAL_BRUTE,
        }
    }

    /// Whether it reads the nodes' boxes.
    pub(crate) fn needs_boxes(self) -> bool {
        matches!(self, Self::MaskBoxes | Self::Backtrack)
    }

    /// Whether it reads the nodes' ropes.
    pub(crate) fn needs_ropes(self) -> bool {
        self == Self::Ropes
    }
}

named_enum!(Traversal {
    Mask = "mask",
    MaskBoxes = "mask-boxes",
    Restart = "restart",
    Backtrack = "backtrack",
    ShortStack = "short-stack",
    Ropes = "ropes",
    Stack = "stack",
    Brute = "brute"
});
