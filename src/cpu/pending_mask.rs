//! Pending subtrees by the paper's bit mask: one bit a level. Twin of `pending_mask.glsl`.

use super::{
    bindings::Bindings,
    kdtree::{Cell, TraversalRay},
    table::Reads,
};

/// Which siblings on the way to the root are still to be visited. Bit d - 1: depth d; one word for the kernel's two.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Mask(pub u64);

#[inline(always)]
pub fn bit_of(depth: u32) -> u64 {
    1 << ((depth - 1) & 63)
}

impl Mask {
    #[inline(always)]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    #[inline(always)]
    pub fn has(self, depth: u32) -> bool {
        self.0 & bit_of(depth) != 0
    }

    /// Depth of the highest bit; the mask is not empty.
    #[inline(always)]
    pub fn deepest(self) -> u32 {
        64 - self.0.leading_zeros()
    }

    /// Takes the highest bit away, and returns its depth.
    #[inline(always)]
    pub fn take_deepest(&mut self) -> u32 {
        let depth = self.deepest();
        self.0 &= !bit_of(depth);
        depth
    }
}

/// How a pending node is found that no stack has kept.
pub trait WayBack {
    /// The deepest pending node, which is pending no more, and where the ray leaves it. `cell` is the leaf just left.
    fn find(mask: &mut Mask, bindings: &Bindings<impl Reads>, ray: &TraversalRay, cell: &mut Cell);
}

/// Up by parent links, and on to the plane where the cell ends.
pub struct Climb;

impl WayBack for Climb {
    #[inline(always)]
    fn find(mask: &mut Mask, bindings: &Bindings<impl Reads>, ray: &TraversalRay, cell: &mut Cell) {
        let parent_of = |node_ix: u32| bindings.kd_parents[(node_ix >> 1) as usize];
        let ancestor_of = |node_ix: u32, n_levels: u32| (0..n_levels).fold(node_ix, |ix, _| parent_of(ix));
        let depth = mask.take_deepest();
        let path_ix = ancestor_of(cell.node_ix, cell.depth - depth);
        *cell = Cell { node_ix: path_ix ^ 1, depth, t_exit: ray.t_exit, ..*cell };
        if !mask.is_empty() {
            let next_ix = ancestor_of(path_ix, depth - mask.deepest());
            cell.t_exit = ray.crossing(bindings.kd_nodes[parent_of(next_ix) as usize]);
        }
    }
}
