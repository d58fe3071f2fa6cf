//! The size of a ray packet, and sets of its rays.

/// The number of rays in a packet.
pub const LANES: usize = 16;

/// A set of a packet's rays: bit i is set if it contains ray i.
pub type LaneMask = u32;
