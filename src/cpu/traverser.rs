//! The ways through the tree, behind one face: a ray at a time, or many.

use std::array::from_fn;

use arrayvec::ArrayVec;
use bytemuck::Zeroable;
use fearless_simd::Level;

use super::{
    bindings::Bindings,
    brute,
    companions::{Window, point_the_same_way, sort_by_direction},
    kdtree::{Pending, TraversalRay, is_within_reach, near_scene, search},
    packet::LANES,
    packet_traverser::PacketTraverser,
    pending_backtrack::PendingBacktrack,
    pending_mask::PendingMask,
    pending_mask_boxes::PendingMaskBoxes,
    pending_short_stack::PendingMarked,
    probe::Probe,
    ropes::follow_ropes,
    table::Reads,
};
use crate::{
    frame::Traversal,
    layout::{Hit, NO_TRIANGLE},
};

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
        let (near, t_start) = near_scene(bindings, probe);
        let mut best = near.miss();
        let ray = &TraversalRay::new(bindings, &near);
        match self {
            Self::Mask(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::MaskBoxes(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Restart(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Backtrack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::ShortStack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Ropes => follow_ropes::<ANY_HIT>(bindings, ray, &mut best),
            Self::Stack(packets) => packets.traverse_alone::<ANY_HIT>(bindings, ray, &mut best),
            Self::Brute => best = brute::closest_hit(bindings.triangles, &near),
        }
        best.t = if best.triangle_ix == NO_TRIANGLE { probe.t_max } else { best.t + t_start };
        best
    }

    /// Tells `found` each ray's hit, as [`Traverser::traverse`] finds it; in their order. With a stack, eight that point
    /// the same way go together.
    #[inline]
    pub fn traverse_all<const ANY_HIT: bool, Key>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        mut probes: impl Iterator<Item = (Key, Probe)>,
        mut found: impl FnMut(Key, Hit),
    ) {
        let Self::Stack(_) = self else {
            return probes.for_each(|(key, probe)| found(key, self.traverse::<ANY_HIT>(bindings, &probe)));
        };
        let mut window = Window::default();
        while window.fill(&mut probes) {
            self.traverse_window::<ANY_HIT, _>(bindings, &mut window);
            window.tell(&mut found);
        }
    }

    /// Finds the window's hits.
    #[inline]
    fn traverse_window<const ANY_HIT: bool, Key>(&mut self, bindings: &Bindings<impl Reads>, window: &mut Window<Key>) {
        let Window { probes, hits, others, .. } = window;
        hits.resize(probes.len(), Hit::zeroed());
        others.clear();
        for (neighbours, first) in probes.chunks(LANES).zip((0..).step_by(LANES)) {
            if point_the_same_way(neighbours) {
                let found = self.traverse_packet::<ANY_HIT>(bindings, neighbours);
                hits[first..][..neighbours.len()].copy_from_slice(&found[..neighbours.len()]);
            } else {
                others.extend(first as u32..(first + neighbours.len()) as u32);
            }
        }
        sort_by_direction(probes, others);
        for ray_ixs in others.chunks(LANES) {
            let companions: ArrayVec<_, LANES> = ray_ixs.iter().map(|&ix| probes[ix as usize]).collect();
            let found = self.traverse_packet::<ANY_HIT>(bindings, &companions);
            ray_ixs.iter().zip(found).for_each(|(&ix, hit)| hits[ix as usize] = hit);
        }
    }

    /// Up to `LANES` rays. What starts far away is rare, and goes alone.
    #[inline]
    fn traverse_packet<const ANY_HIT: bool>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        probes: &[Probe],
    ) -> [Hit; LANES] {
        match self {
            Self::Stack(packets) if probes.iter().all(|probe| is_within_reach(bindings, probe)) => {
                packets.traverse::<ANY_HIT>(bindings, probes)
            }
            _ => from_fn(|i| self.traverse::<ANY_HIT>(bindings, probes.get(i).unwrap_or(&probes[0]))),
        }
    }
}
