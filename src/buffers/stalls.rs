//! Stalled rays: rays that stop on their way through the acceleration structure, and go on in further dispatches
//! (glsl/shared/stalls.glsl).
//!
//! Some drivers silently end a shader after a number of loop turns. On such a device, a ray that has spent its turns
//! stores its state and leaves a mark in place of its result. The host repeats the dispatch until no ray is marked.
//! So no ray ends early, and no dispatch is unbounded.

use std::sync::Arc;

use crate::{
    gpu::{Access, Binding, Buffer, BufferUse, Commands, Context, GpuError},
    layout::{BIND_STALLS, KD_MAX_DEPTH, ROUND_BEGIN, ROUND_RESTART, ROUND_RESUME, STALLED_RAY_ROWS},
};

/// The most rays whose state is stored at a time: 3 MiB. Further rays begin again when there is room.
const N_SLOTS: usize = 1 << 16;

/// First row of `stalls`, with four words:
///
/// 0. the number of slots that rays have requested, which can be more than there are,
/// 1. the number of rays of the last dispatch that have stalled and have a slot,
/// 2. the number of stalled rays that have no slot,
/// 3. unused.
type Counts = [u32; 4];

/// Round of a dispatch: the rays that it traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Round {
    /// All rays, from their beginning.
    Begin,
    /// Rays that have stalled, from where they stopped.
    Resume,
    /// Rays that stalled when no slot was left, from their beginning.
    Restart,
}

impl Round {
    /// The value of the push constant `round`.
    pub fn constant(self) -> u32 {
        match self {
            Self::Begin => ROUND_BEGIN,
            Self::Resume => ROUND_RESUME,
            Self::Restart => ROUND_RESTART,
        }
    }
}

/// Buffer of stalled rays. It has no slots if the device has no limit of turns. A clone is a second handle to the
/// same buffer.
#[derive(Clone)]
pub struct Stalls {
    /// The counts, then `STALLED_RAY_ROWS` rows for each slot.
    rows: Buffer<[u32; 4]>,
    /// The turns that a ray takes in a dispatch; 0: any number.
    turn_budget: u32,
}

impl Stalls {
    /// Makes the buffer. The first call on a device probes its limit of turns.
    ///
    /// # Errors
    /// Memory runs out, or the probe does not run.
    pub fn new(context: &Arc<Context>) -> Result<Self, GpuError> {
        let turn_budget = context.loop_limit()?.map_or(0, |limit| turn_budget(limit, context.info().subgroup_size));
        let most_rows = context.limits().storage_range as usize / size_of::<Counts>();
        let most_slots = (most_rows - 1) / STALLED_RAY_ROWS as usize;
        let n_slots = context.overrides().n_stall_slots.unwrap_or(N_SLOTS).min(most_slots);
        let n_slots = if turn_budget == 0 { 0 } else { n_slots };
        let n_rows = 1 + STALLED_RAY_ROWS as usize * n_slots;
        Ok(Self { rows: Buffer::new(context, "stalls", n_rows, BufferUse::Storage)?, turn_budget })
    }

    /// Whether rays can stall on this device.
    pub fn can_occur(&self) -> bool {
        self.turn_budget > 0
    }

    /// The value of the kernels' specialization constant `TURN_BUDGET`.
    pub(super) fn turn_budget(&self) -> u32 {
        self.turn_budget
    }

    /// The number of the buffer's binding, and the buffer.
    pub(super) fn object(&self) -> (u32, Binding<'_>) {
        (BIND_STALLS, Binding::Buffer(self.rows.any()))
    }

    /// Records that all slots become empty. A dispatch of [`Round::Begin`] follows. The caller needs no barrier.
    pub fn reset(&self, commands: &Commands) {
        if self.can_occur() {
            self.set_counts(commands, &Counts::default());
        }
    }

    fn set_counts(&self, commands: &Commands, counts: &Counts) {
        commands.barrier(Access::ComputeUpdate, Access::TransferWrite); // stalls of the previous dispatch
        commands.update_buffer(self.rows.any(), std::slice::from_ref(counts));
        commands.barrier(Access::TransferWrite, Access::ComputeUpdate); // stalls
    }

    /// Repeats a dispatch that has run as [`Round::Begin`] until every ray has ended. Returns the number of
    /// repetitions. `record`: records the dispatch for a round.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn finish(&self, context: &Arc<Context>, record: impl Fn(&Commands, Round)) -> Result<u32, GpuError> {
        if !self.can_occur() {
            return Ok(0);
        }
        let mut n_rounds = 0;
        loop {
            let [n_slots, n_stalled, n_waiting, _] = self.rows.download_first(1)?[0];
            // Rays without a slot do not run in a round of `Resume`, so their count is kept for a round of `Restart`.
            let (round, counts) = match (n_stalled, n_waiting) {
                (1.., _) => (Round::Resume, [n_slots, 0, n_waiting, 0]),
                (0, 1..) => (Round::Restart, Counts::default()),
                (0, 0) => return Ok(n_rounds),
            };
            tracing::debug!(n_rounds, ?round, "rays have stalled");
            context.run("stalled rays", |commands| {
                self.set_counts(commands, &counts);
                record(commands, round);
                commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // hits or light_visibility, stalls
            })?;
            n_rounds += 1;
        }
    }
}

/// Returns the loop turns that one invocation may take so that its subgroup stays below the device's limit.
///
/// The driver counts the turns of a subgroup. A subgroup stays in a loop while any of its lanes does. It takes one
/// turn of a loop even if no lane enters the loop. So a turn of the outer loop costs up to `TURNS_OF_ALL` turns
/// whatever its lanes do: its own, two of the loop that goes from leaf to leaf, and in each of those two, one of
/// every loop inside. All further turns are taken by some lane. So if no lane takes more than `b` turns, outer and
/// inner ones together, the subgroup takes no more than `(TURNS_OF_ALL + subgroup_size) b`. Two kinds of turns come
/// on top. A lane whose turns are spent still finishes its step. A lane that resumes a ray first walks back to where
/// the ray stopped. These are up to `TURNS_ASIDE` turns per lane, four times a tree's greatest depth.
fn turn_budget(limit: u32, subgroup_size: u32) -> u32 {
    const TURNS_OF_ALL: u32 = 12;
    const TURNS_ASIDE: u32 = 4 * KD_MAX_DEPTH;
    let aside = (TURNS_ASIDE * subgroup_size).min(limit / 2);
    ((limit - aside) / (TURNS_OF_ALL + subgroup_size)).max(4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subgroups_stay_below_the_limit() {
        for subgroup_size in [4, 8, 16, 32] {
            let budget = turn_budget(65_535, subgroup_size);
            assert!((12 + subgroup_size) * budget + 256 * subgroup_size <= 65_535);
            assert!(budget > 1000, "{budget} turns in subgroups of {subgroup_size}");
        }
    }
}
