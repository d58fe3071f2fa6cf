//! Suspended rays: rays that stop on their way through the acceleration structure, and go on in further dispatches
//! (glsl/shared/search/suspended_rays.glsl).
//!
//! Some drivers silently end a shader after a number of loop iterations. On such a device, a ray that has spent its
//! iterations stores its state and leaves a mark in place of its result. The host repeats the dispatch until no ray is
//! marked. So no ray ends early, and no dispatch is unbounded.

use std::sync::Arc;

use crate::{
    gpu::{Access, Binding, Buffer, BufferUse, Commands, Context, GpuError},
    layout::{BIND_SUSPENDED_RAYS, KD_MAX_DEPTH, NO_SLOT, PASS_BEGIN, PASS_RESTART, PASS_RESUME, SUSPENDED_RAY_ROWS},
};

/// The most rays whose state is stored at a time: 3 MiB. Further rays begin again when there is room.
const N_SLOTS: usize = 1 << 16;

/// First row of `suspended_rays`, with four words:
///
/// 0. the number of slots that rays have requested, which can be more than there are,
/// 1. the number of rays of the last dispatch that were suspended and have a slot,
/// 2. the number of suspended rays that have no slot,
/// 3. unused.
type Counts = [u32; 4];

/// The rays that a dispatch traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResumePass {
    /// All rays, from their beginning.
    Begin,
    /// Rays that were suspended, from where they stopped.
    Resume,
    /// Rays that were suspended when no slot was left, from their beginning.
    Restart,
}

impl ResumePass {
    /// The value of the push constant `resume_pass`.
    pub fn constant(self) -> u32 {
        match self {
            Self::Begin => PASS_BEGIN,
            Self::Resume => PASS_RESUME,
            Self::Restart => PASS_RESTART,
        }
    }
}

/// Buffer of suspended rays. It has no slots if the device has no limit of iterations. A clone is a second handle to
/// the same buffer.
#[derive(Clone)]
pub struct SuspendedRays {
    /// The counts, then `SUSPENDED_RAY_ROWS` rows for each slot.
    rows: Buffer<[u32; 4]>,
    /// The iterations that a ray takes in a dispatch; 0: any number.
    iteration_budget: u32,
}

impl SuspendedRays {
    /// Makes the buffer. The first call on a device probes its limit of iterations.
    ///
    /// # Errors
    /// Memory runs out, or the probe does not run.
    pub fn new(context: &Arc<Context>) -> Result<Self, GpuError> {
        let iteration_budget =
            context.loop_limit()?.map_or(0, |limit| iteration_budget(limit, context.info().subgroup_size));
        let most_rows = context.limits().storage_range as usize / size_of::<Counts>();
        let most_slots = (most_rows - 1) / SUSPENDED_RAY_ROWS as usize;
        let n_slots = context.overrides().n_suspension_slots.unwrap_or(N_SLOTS).min(most_slots).min(NO_SLOT as usize);
        let n_slots = if iteration_budget == 0 { 0 } else { n_slots };
        let n_rows = 1 + SUSPENDED_RAY_ROWS as usize * n_slots;
        Ok(Self { rows: Buffer::new(context, "suspended_rays", n_rows, BufferUse::Storage)?, iteration_budget })
    }

    /// Whether rays can be suspended on this device.
    pub fn can_occur(&self) -> bool {
        self.iteration_budget > 0
    }

    /// The value of the kernels' specialization constant `ITERATION_BUDGET`.
    pub(super) fn iteration_budget(&self) -> u32 {
        self.iteration_budget
    }

    /// The number of the buffer's binding, and the buffer.
    pub(super) fn object(&self) -> (u32, Binding<'_>) {
        (BIND_SUSPENDED_RAYS, Binding::Buffer(self.rows.any()))
    }

    /// Records that all slots become empty. A dispatch of [`ResumePass::Begin`] follows. The caller needs no barrier.
    pub fn reset(&self, commands: &Commands) {
        if self.can_occur() {
            self.set_counts(commands, &Counts::default());
        }
    }

    fn set_counts(&self, commands: &Commands, counts: &Counts) {
        commands.barrier(Access::ComputeUpdate, Access::TransferWrite); // suspended_rays of the previous dispatch
        commands.update_buffer(self.rows.any(), std::slice::from_ref(counts));
        commands.barrier(Access::TransferWrite, Access::ComputeUpdate); // suspended_rays
    }

    /// Repeats a dispatch that has run as [`ResumePass::Begin`] until every ray has ended. Returns the number of
    /// repetitions. `record`: records the dispatch of a resume pass.
    ///
    /// # Errors
    /// A Vulkan call fails.
    pub fn finish(&self, context: &Arc<Context>, record: impl Fn(&Commands, ResumePass)) -> Result<u32, GpuError> {
        if !self.can_occur() {
            return Ok(0);
        }
        let mut n_resume_passes = 0;
        loop {
            let [n_slots, n_suspended, n_waiting, _] = self.rows.download_first(1)?[0];
            // Rays without a slot do not run in a pass of `Resume`, so their count is kept for a pass of `Restart`.
            let (resume_pass, counts) = match (n_suspended, n_waiting) {
                (1.., _) => (ResumePass::Resume, [n_slots, 0, n_waiting, 0]),
                (0, 1..) => (ResumePass::Restart, Counts::default()),
                (0, 0) => return Ok(n_resume_passes),
            };
            tracing::debug!(n_resume_passes, ?resume_pass, "rays were suspended");
            context.run("suspended rays", |commands| {
                self.set_counts(commands, &counts);
                record(commands, resume_pass);
                commands.barrier(Access::ComputeWrite, Access::ComputeUpdate); // results, suspended_rays
            })?;
            n_resume_passes += 1;
        }
    }
}

/// Returns the loop iterations that one invocation may take so that its subgroup stays below the device's limit.
///
/// The driver counts the iterations of a subgroup. A subgroup stays in a loop while any of its lanes does. It takes one
/// iteration of a loop even if no lane enters the loop. So an iteration of the outer loop costs up to
/// `ITERATIONS_OF_ALL` iterations whatever its lanes do: its own, two of the loop that goes from leaf to leaf, and in
/// each of those two, one of every loop inside. All further iterations are taken by some lane. So if no lane takes more
/// than `b` iterations, outer and inner ones together, the subgroup takes no more than `(ITERATIONS_OF_ALL +
/// subgroup_size) b`. Two kinds of iterations come on top. A lane whose iterations are spent still finishes its step. A
/// lane that resumes a ray first walks back to where the ray stopped. These are up to `ITERATIONS_ASIDE` iterations per
/// lane, four times a tree's greatest depth.
fn iteration_budget(limit: u32, subgroup_size: u32) -> u32 {
    const ITERATIONS_OF_ALL: u32 = 12;
    const ITERATIONS_ASIDE: u32 = 4 * KD_MAX_DEPTH;
    let aside = (ITERATIONS_ASIDE * subgroup_size).min(limit / 2);
    ((limit - aside) / (ITERATIONS_OF_ALL + subgroup_size)).max(4)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subgroups_stay_below_the_limit() {
        for subgroup_size in [4, 8, 16, 32] {
            let budget = iteration_budget(65_535, subgroup_size);
            assert!((12 + subgroup_size) * budget + 256 * subgroup_size <= 65_535);
            assert!(budget > 1000, "{budget} iterations in subgroups of {subgroup_size}");
        }
    }
}
