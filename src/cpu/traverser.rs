//! The ways through the tree, behind one face: a ray at a time, or many.

use fearless_simd::Level;

use super::{
    bindings::Bindings,
    brute,
    companions::{Companions, Waiting},
    kdtree::{Pending, TraversalRay, hit_from_near, search},
    packet_traverser::PacketTraverser,
    pending_backtrack::PendingBacktrack,
    pending_mask::PendingMask,
    pending_mask_boxes::PendingMaskBoxes,
    pending_short_stack::PendingMarked,
    probe::Probe,
    ropes::follow_ropes,
    table::Reads,
};
use crate::{accel::kdtree::Traversal, layout::Hit};

/// A traversal that remembers its working memory from ray to ray; one for each thread.
#[expect(clippy::large_enum_variant, reason = "one a thread, on its stack")]
pub enum Traverser {
    Mask(PendingMask),
    MaskBoxes(PendingMaskBoxes),
    Restart(PendingMarked<0>),
    Backtrack(PendingBacktrack),
    ShortStack(PendingMarked<8>),
    Ropes,
    Stack(PacketTraverser),
    Brute,
}

impl Traverser {
    pub fn new(traversal: Traversal) -> Self {
        Self::at_level(traversal, Level::new())
    }

    /// With the instructions of that level, which the machine has: the same hits, bit for bit.
    pub fn at_level(traversal: Traversal, level: Level) -> Self {
        match traversal {
            Traversal::Mask => Self::Mask(Pending::new()),
            Traversal::MaskBoxes => Self::MaskBoxes(Pending::new()),
            Traversal::Restart => Self::Restart(Pending::new()),
            Traversal::Backtrack => Self::Backtrack(Pending::new()),
            Traversal::ShortStack => Self::ShortStack(Pending::new()),
            Traversal::Ropes => Self::Ropes,
            Traversal::Stack => Self::Stack(PacketTraverser::new(level)),
            Traversal::Brute => Self::Brute,
        }
    }

    /// The closest hit in (t_min, t_max], or with `ANY_HIT` one that need not be the closest. A miss keeps t = t_max.
    #[inline]
    pub fn traverse<const ANY_HIT: bool>(&mut self, bindings: &Bindings<impl Reads>, probe: &Probe) -> Hit {
        hit_from_near(bindings, probe, |near, best| {
            let ray = &TraversalRay::new(bindings, near);
            match self {
                Self::Mask(pending) => search::<_, ANY_HIT>(bindings, ray, pending, best),
                Self::MaskBoxes(pending) => search::<_, ANY_HIT>(bindings, ray, pending, best),
                Self::Restart(pending) => search::<_, ANY_HIT>(bindings, ray, pending, best),
                Self::Backtrack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, best),
                Self::ShortStack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, best),
                Self::Ropes => follow_ropes::<ANY_HIT>(bindings, ray, best),
                Self::Stack(packets) => packets.traverse_alone::<ANY_HIT>(bindings, ray, best),
                Self::Brute => *best = brute::closest_hit(bindings.triangles, near),
            }
        })
    }

    /// Tells `found` each ray's hit, as [`Traverser::traverse`] finds it; with a stack in no order, since those of a direction
    /// go together.
    #[inline]
    pub fn traverse_all<const ANY_HIT: bool, Key>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        probes: impl Iterator<Item = (Key, Probe)>,
        mut found: impl FnMut(Key, Hit),
    ) {
        let Self::Stack(packets) = self else {
            return probes.for_each(|(key, probe)| found(key, self.traverse::<ANY_HIT>(bindings, &probe)));
        };
        let mut companions = Companions::default();
        let mut traverse = |Waiting { probes, keys }: &mut Waiting<Key>| {
            let hits = packets.traverse::<ANY_HIT>(bindings, probes, keys.len());
            keys.drain(..).enumerate().for_each(|(lane, key)| found(key, hits.get(lane)));
        };
        for (key, probe) in probes {
            if let Some(packet) = companions.join(key, &probe) {
                traverse(packet);
            }
        }
        companions.rest().for_each(traverse);
    }
}
