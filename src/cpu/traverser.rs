//! The ways through the tree, behind one face: a ray at a time, or many.

use std::array::from_fn;

use arrayvec::ArrayVec;

use super::{
    bindings::Bindings,
    brute,
    kdtree::{Pending, TraversalRay, is_within_reach, near_scene, search},
    packet::LANES,
    packet_traverser::PacketTraverser,
    pending_backtrack::PendingBacktrack,
    pending_mask::Climb,
    pending_mask_boxes::PendingMaskBoxes,
    pending_restart::Retrace,
    pending_short_stack::PendingMarked,
    ropes::follow_ropes,
    table::Reads,
};
use crate::{
    frame::Traversal,
    layout::{Hit, NO_TRIANGLE, Ray},
};

/// A ray that is to be traced in (t_min, ray.t_max].
#[derive(Clone, Copy, Debug)]
pub struct Probe {
    pub ray: Ray,
    pub t_min: f32,
}

impl From<&Ray> for Probe {
    fn from(ray: &Ray) -> Self {
        Self { ray: *ray, t_min: 0.0 }
    }
}

impl Probe {
    /// What is there before anything is hit.
    pub fn miss(&self) -> Hit {
        Hit { t: self.ray.t_max, triangle_ix: NO_TRIANGLE, u: 0.0, v: 0.0 }
    }
}

/// Rays that point into more octants than this share too little of their way to go together.
const MOST_OCTANTS: u32 = 2;

/// Into how many octants the rays point.
fn n_octants(probes: &[Probe]) -> u32 {
    let octant_of = |probe: &Probe| probe.ray.direction.is_negative_bitmask();
    probes.iter().fold(0_u32, |octants, probe| octants | 1 << octant_of(probe)).count_ones()
}

/// A traversal that remembers its working memory from ray to ray; one for each thread.
#[expect(clippy::large_enum_variant, reason = "one a thread, on its stack")]
pub enum Traverser {
    Mask(PendingMarked<Climb, 8>),
    MaskBoxes(PendingMaskBoxes),
    Restart(PendingMarked<Retrace, 0>),
    Backtrack(PendingBacktrack),
    ShortStack(PendingMarked<Retrace, 8>),
    Ropes,
    Stack(PacketTraverser),
    Brute,
}

impl Traverser {
    pub fn new(traversal: Traversal) -> Self {
        match traversal {
            Traversal::Mask => Self::Mask(Pending::new()),
            Traversal::MaskBoxes => Self::MaskBoxes(Pending::new()),
            Traversal::Restart => Self::Restart(Pending::new()),
            Traversal::Backtrack => Self::Backtrack(Pending::new()),
            Traversal::ShortStack => Self::ShortStack(Pending::new()),
            Traversal::Ropes => Self::Ropes,
            Traversal::Stack => Self::Stack(PacketTraverser::default()),
            Traversal::Brute => Self::Brute,
        }
    }

    /// The closest hit in (t_min, t_max], or with `ANY_HIT` one that need not be the closest. A miss keeps t = t_max.
    #[inline]
    pub fn traverse<const ANY_HIT: bool>(&mut self, bindings: &Bindings<impl Reads>, probe: &Probe) -> Hit {
        let (ray_in, t_min) = (&probe.ray, probe.t_min);
        let (near, t_start) = near_scene(bindings, ray_in);
        let mut best = Hit { t: near.t_max, ..probe.miss() };
        let ray = &TraversalRay::new(bindings, &near, t_min - t_start);
        match self {
            Self::Mask(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::MaskBoxes(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Restart(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Backtrack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::ShortStack(pending) => search::<_, ANY_HIT>(bindings, ray, pending, &mut best),
            Self::Ropes => follow_ropes::<ANY_HIT>(bindings, ray, &mut best),
            Self::Stack(packets) => search::<_, ANY_HIT>(bindings, ray, &mut packets.single, &mut best),
            Self::Brute => best = brute::closest_hit_beyond(bindings.triangles, &near, t_min - t_start),
        }
        best.t = if best.triangle_ix == NO_TRIANGLE { ray_in.t_max } else { best.t + t_start };
        best
    }

    /// Tells `found` each ray's hit, as [`Traverser::traverse`] finds it; with a stack, eight neighbours go together.
    #[inline]
    pub fn traverse_all<const ANY_HIT: bool, Key>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        probes: impl Iterator<Item = (Key, Probe)>,
        mut found: impl FnMut(Key, Hit),
    ) {
        let Self::Stack(_) = self else {
            return probes.for_each(|(key, probe)| found(key, self.traverse::<ANY_HIT>(bindings, &probe)));
        };
        let mut probes = probes.peekable();
        while probes.peek().is_some() {
            let (keys, packet): (ArrayVec<_, LANES>, ArrayVec<_, LANES>) = probes.by_ref().take(LANES).unzip();
            let hits = self.traverse_packet::<ANY_HIT>(bindings, &packet);
            keys.into_iter().zip(hits).for_each(|(key, hit)| found(key, hit));
        }
    }

    /// Up to `LANES` rays. What starts far away is rare, and goes alone; so do rays all over the place.
    #[inline]
    fn traverse_packet<const ANY_HIT: bool>(
        &mut self,
        bindings: &Bindings<impl Reads>,
        probes: &[Probe],
    ) -> [Hit; LANES] {
        match self {
            Self::Stack(packets)
                if probes.iter().all(|probe| is_within_reach(bindings, &probe.ray))
                    && n_octants(probes) <= MOST_OCTANTS =>
            {
                packets.traverse::<ANY_HIT>(bindings, probes)
            }
            _ => from_fn(|i| self.traverse::<ANY_HIT>(bindings, probes.get(i).unwrap_or(&probes[0]))),
        }
    }
}
