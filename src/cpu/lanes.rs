//! How many rays go together, and sets of them.

/// The number of rays in a packet.
pub const LANES: usize = 16;

/// Some of a packet's rays: bit i is set if ray i is one of them.
pub type LaneMask = u32;
