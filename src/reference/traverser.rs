//! One interface for the algorithms that take rays through a kd-tree and for the search through a grid. Rays are
//! traced one after the other.

use super::{
    candidate::intersect,
    counting::table::ReadCounter,
    grid::search_grid,
    inputs::KernelInputs,
    instances::search_instances,
    kdtree::{Pending, search},
    pending_backtrack::PendingBacktrack,
    pending_mask::PendingMask,
    pending_mask_boxes::PendingMaskBoxes,
    pending_short_stack::PendingTrail,
    pending_stack::PendingStack,
    ropes::follow_ropes,
    search_ray::SearchRay,
    traversal_ray::{TraversalRay, hit_from_near},
};
use crate::{
    accel::kdtree::Traversal,
    layout::{Hit, SHORT_STACK_SIZE},
};

/// Finds the hits of rays. Each thread has its own tracer.
pub trait Tracer {
    /// Finds a ray's closest hit in (t_min, t_max], or with `ANY_HIT` one that need not be the closest. A miss has
    /// t = t_max.
    fn traverse<const ANY_HIT: bool>(&mut self, inputs: &KernelInputs<impl ReadCounter>, search_ray: &SearchRay)
    -> Hit;

    /// Calls `found` with the key of each ray and the hit that [`Self::traverse`] finds. The calls come in any order.
    #[inline]
    fn trace_all<const ANY_HIT: bool, Key>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        search_rays: impl Iterator<Item = (Key, SearchRay)>,
        mut found: impl FnMut(Key, Hit),
    ) {
        search_rays.for_each(|(key, search_ray)| found(key, self.traverse::<ANY_HIT>(inputs, &search_ray)));
    }
}

/// An algorithm with its working memory, which is reused from ray to ray.
pub enum Traverser {
    Mask(PendingMask),
    MaskBoxes(PendingMaskBoxes),
    Restart(PendingTrail<0>),
    Backtrack(PendingBacktrack),
    ShortStack(PendingTrail<{ SHORT_STACK_SIZE as usize }>),
    Ropes,
    Stack(PendingStack),
    Brute,
    Grid,
}

impl Traverser {
    /// Makes a traverser for the acceleration structure of the inputs. `traversal` is the algorithm for a kd-tree. A
    /// grid ignores it.
    pub fn new(inputs: &KernelInputs<impl ReadCounter>, traversal: Traversal) -> Self {
        match traversal {
            _ if inputs.n_grid_levels > 0 => Self::Grid,
            Traversal::Mask => Self::Mask(Pending::new()),
            Traversal::MaskBoxes => Self::MaskBoxes(Pending::new()),
            Traversal::Restart => Self::Restart(Pending::new()),
            Traversal::Backtrack => Self::Backtrack(Pending::new()),
            Traversal::ShortStack => Self::ShortStack(Pending::new()),
            Traversal::Ropes => Self::Ropes,
            Traversal::Stack => Self::Stack(Pending::new()),
            Traversal::Brute => Self::Brute,
        }
    }

    /// Searches the structure, which has no instances. Keeps the nearest hit in `best`.
    #[inline(always)]
    pub(super) fn search<const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        ray: &TraversalRay,
        best: &mut Hit,
    ) {
        match self {
            Self::Mask(pending) => search::<_, ANY_HIT>(inputs, ray, pending, best),
            Self::MaskBoxes(pending) => search::<_, ANY_HIT>(inputs, ray, pending, best),
            Self::Restart(pending) => search::<_, ANY_HIT>(inputs, ray, pending, best),
            Self::Backtrack(pending) => search::<_, ANY_HIT>(inputs, ray, pending, best),
            Self::ShortStack(pending) => search::<_, ANY_HIT>(inputs, ray, pending, best),
            Self::Stack(pending) => search::<_, ANY_HIT>(inputs, ray, pending, best),
            Self::Grid => search_grid::<ANY_HIT>(inputs, ray, best),
            Self::Ropes => follow_ropes::<ANY_HIT>(inputs, ray, best),
            Self::Brute => {
                inputs.leaf_triangles.count(inputs.triangles.len());
                let triangles = 0..inputs.triangles.len() as u32;
                triangles.for_each(|triangle_ix| intersect(inputs, &ray.hit_filter, triangle_ix, best));
            }
        }
    }
}

impl Tracer for Traverser {
    #[inline]
    fn traverse<const ANY_HIT: bool>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        search_ray: &SearchRay,
    ) -> Hit {
        if let (Some(instanced), None) = (&inputs.instanced, inputs.inside) {
            let search = |geometry: &KernelInputs<_>, ray: &SearchRay| self.traverse::<ANY_HIT>(geometry, ray);
            return search_instances::<_, ANY_HIT>(inputs, instanced, search_ray, search);
        }
        hit_from_near(inputs, search_ray, |near, best| {
            self.search::<ANY_HIT>(inputs, &TraversalRay::new(inputs, near), best);
        })
    }
}
