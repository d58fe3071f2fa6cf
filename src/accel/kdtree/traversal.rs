//! Traversal algorithms of the kd-tree. They differ in how they find the pending subtrees: far children that the ray
//! has passed and still has to visit. README.md names the paper that comments here refer to.

/// Traversal algorithm of the kd-tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversal {
    /// A bit mask: one bit per level says whether the sibling there is still to be visited. Pending subtrees are kept
    /// in local memory, in the order of the bits.
    Mask,
    /// The paper's own bit mask: one bit per level says whether the sibling there is done. The ray is tested against
    /// the box of a sibling that is not done, and visits the sibling if the ray meets the box.
    MaskBoxes,
    /// Restarts: each pending subtree is found again from the root.
    Restart,
    /// Backtracking: the ray goes back to the deepest ancestor that it has not left, which it finds by the nodes'
    /// boxes.
    Backtrack,
    /// A short stack: the eight newest pending subtrees are kept, and older ones are found by a restart.
    ShortStack,
    /// Ropes: links from each leaf to its neighbours.
    Ropes,
    /// A stack: an array of pending subtrees. On the CPU, packets of sixteen rays go through the tree; scattered rays,
    /// such as those of most paths, may go singly through a wide hierarchy (`cpu/wide_traverser.rs` says when).
    Stack,
    /// Brute force: every triangle is tested, without a tree. For small meshes.
    Brute,
}

impl Traversal {
    /// The algorithm for GPUs, which follows the paper's idea. A stack and ropes are up to a tenth faster on some
    /// scenes (figures in docs/performance.md).
    pub const OF_GPUS: Self = Self::Mask;
    /// The fastest algorithm on software drivers, which run kernels on the CPU.
    pub const OF_SOFTWARE_DRIVERS: Self = Self::Ropes;
    /// The fastest algorithm on the CPU without a driver.
    pub const OF_CPU: Self = Self::Stack;

    /// Whether the algorithm reads the nodes' boxes.
    pub(crate) fn needs_boxes(self) -> bool {
        matches!(self, Self::MaskBoxes | Self::Backtrack)
    }

    /// Whether the algorithm reads the nodes' parents.
    pub(crate) fn needs_parents(self) -> bool {
        self.needs_boxes()
    }

    /// Whether the algorithm reads the nodes' ropes.
    pub(crate) fn needs_ropes(self) -> bool {
        self == Self::Ropes
    }
}

named_enum!(Traversal {
    Mask = "mask": "one bit a level for siblings that are still to be visited; their intervals are in local memory",
    MaskBoxes = "mask-boxes": "the paper's own: one bit a level for finished siblings; nodes' boxes say which to visit",
    Restart = "restart": "each subtree that is still to be visited is found again from the root",
    Backtrack = "backtrack": "back to the deepest ancestor that the ray has not left, found by the nodes' boxes",
    ShortStack = "short-stack": "the eight newest far children are kept, older ones are found by a restart",
    Ropes = "ropes": "from leaf to leaf, along links to neighbours",
    Stack = "stack": "a stack of all far children; with --cpu packets of sixteen rays",
    Brute = "brute": "every triangle is tested, without a tree; for small meshes",
});
