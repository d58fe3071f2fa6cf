//! The tracer of the CPU engine. With [`Traversal::Stack`], rays of one class of directions ([`DirectionBins`]) go
//! through a kd-tree as packets, and rays that have little in common one by one through a wide hierarchy. With any
//! other algorithm, or through a grid, rays are traced one after the other.

use fearless_simd::Level;

use super::{
    direction_bins::{Bin, DirectionBins},
    packet_traverser::PacketTraverser,
    wide_traverser::WideTraverser,
};
use crate::{
    accel::{kdtree::Traversal, wide_bvh::WideBvh},
    layout::Hit,
    reference::{
        counting::table::ReadCounter,
        inputs::KernelInputs,
        instances::search_instances,
        search_ray::SearchRay,
        traversal_ray::{TraversalRay, hit_from_near},
        traverser::{Tracer, Traverser},
    },
};

/// How the CPU finds hits.
#[derive(Clone, Copy)]
pub struct CpuSearch<'a> {
    /// The algorithm for the kd-tree. A grid ignores it.
    pub traversal: Traversal,
    /// The hierarchy through which rays go one by one, in place of the kd-tree.
    pub wide: Option<&'a WideBvh>,
}

impl From<Traversal> for CpuSearch<'_> {
    fn from(traversal: Traversal) -> Self {
        Self { traversal, wide: None }
    }
}

/// The tracer of one thread.
#[expect(clippy::large_enum_variant, reason = "one a thread, on its stack")]
pub enum FastTracer<'a> {
    /// Traces packets through a kd-tree by [`Traversal::Stack`].
    Packets(PacketTraverser),
    /// Traces ray by ray through a wide hierarchy.
    Wide(WideTraverser<'a>),
    /// Traces ray by ray, by any other algorithm or through a grid.
    Single(Traverser),
}

impl<'a> FastTracer<'a> {
    /// Creates a tracer that uses the best instructions that the machine has.
    pub fn new(inputs: &KernelInputs<impl ReadCounter>, search: impl Into<CpuSearch<'a>>) -> Self {
        Self::at_simd_level(inputs, search, Level::new())
    }

    /// Creates a tracer that uses the instructions of `simd_level`, which the machine must have. The hits are the same
    /// at every SIMD level, bit for bit.
    pub fn at_simd_level(
        inputs: &KernelInputs<impl ReadCounter>,
        search: impl Into<CpuSearch<'a>>,
        simd_level: Level,
    ) -> Self {
        match search.into() {
            CpuSearch { wide: Some(bvh), .. } => Self::Wide(WideTraverser::new(bvh, simd_level)),
            CpuSearch { traversal: Traversal::Stack, .. } if inputs.n_grid_levels == 0 => {
                Self::Packets(PacketTraverser::new(simd_level))
            }
            CpuSearch { traversal, .. } => Self::Single(Traverser::new(inputs, traversal)),
        }
    }
}

impl Tracer for FastTracer<'_> {
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
        match self {
            Self::Packets(packets) => hit_from_near(inputs, search_ray, |near, best| {
                packets.traverse_alone::<ANY_HIT>(inputs, &TraversalRay::new(inputs, near), best);
            }),
            Self::Wide(traverser) => traverser.traverse::<ANY_HIT>(inputs, search_ray),
            Self::Single(traverser) => traverser.traverse::<ANY_HIT>(inputs, search_ray),
        }
    }

    #[inline]
    fn trace_all<const ANY_HIT: bool, Key>(
        &mut self,
        inputs: &KernelInputs<impl ReadCounter>,
        search_rays: impl Iterator<Item = (Key, SearchRay)>,
        mut found: impl FnMut(Key, Hit),
    ) {
        if inputs.instanced.is_some() {
            return search_rays.for_each(|(key, search_ray)| found(key, self.traverse::<ANY_HIT>(inputs, &search_ray)));
        }
        let packets = match self {
            Self::Packets(packets) => packets,
            Self::Wide(traverser) => return traverser.trace_all::<ANY_HIT, Key>(inputs, search_rays, found),
            Self::Single(traverser) => return traverser.trace_all::<ANY_HIT, Key>(inputs, search_rays, found),
        };
        let mut bins = DirectionBins::default();
        let mut traverse = |Bin { rays, keys }: &mut Bin<Key>| {
            let hits = packets.traverse::<ANY_HIT>(inputs, rays, keys.len());
            keys.drain(..).enumerate().for_each(|(lane, key)| found(key, hits.get(lane)));
        };
        for (key, search_ray) in search_rays {
            if let Some(packet) = bins.push(key, &search_ray) {
                traverse(packet);
            }
        }
        bins.non_empty().for_each(traverse);
    }
}
