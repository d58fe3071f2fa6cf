//! Timing of kernels that trace the same rays on a device. The kernels are contenders, and run in turn.

use std::{rc::Rc, sync::Arc};

use crate::{
    buffers::CastResources,
    gpu::{Access, CommandBuffer, Commands, Context, GpuError, Timer},
};

/// A kernel that traces rays on the device and is timed against others.
pub trait Contender {
    /// Returns the name in reports.
    fn name(&self) -> String;

    /// Returns how the kernel accesses rays and hits.
    fn access(&self) -> Access;

    /// Records one cast of all rays as one pass. It reads `cast_rays` and writes `cast_hits`, one hit for each ray.
    fn record(&self, commands: &Commands);

    /// Returns the buffers of rays and hits. Contenders may share them.
    fn resources(&self) -> &Rc<CastResources>;
}

/// Runs every contender once in each round, and returns the milliseconds of `n_rounds` rounds: one entry for each
/// contender, round by round. An entry is None where the device has no timestamps. An additional first round is not
/// counted, because its times depend on the caches and clocks that earlier work has left.
pub(crate) fn time_in_turn(
    context: &Arc<Context>,
    contenders: &[Box<dyn Contender>],
    n_rounds: u16,
) -> Result<Vec<Option<f64>>, GpuError> {
    let n_passes = contenders.len() * (1 + usize::from(n_rounds));
    let timer = Timer::new(context, n_passes as u32)?;
    let record = |pass_ix: usize| {
        let contender = &contenders[pass_ix % contenders.len()];
        let before = &contenders[(pass_ix + contenders.len() - 1) % contenders.len()];
        CommandBuffer::record(context, &contender.name(), Some(&timer), |commands| {
            if pass_ix == 0 {
                commands.reset_timer();
                commands.barrier(Access::TransferWrite, contender.access()); // cast_rays, cast_hits
            }
            commands.barrier(before.access(), contender.access()); // cast_hits
            contender.record(commands);
        })
    };
    let buffers = (0..n_passes).map(record).collect::<Result<Vec<_>, _>>()?;
    context.wait_for(context.submit(buffers)?)?;
    let rows = timer.rows()?;
    assert_eq!(rows.len(), n_passes, "a contender is one pass");
    Ok(rows[contenders.len()..].iter().map(|row| row.span_ms.map(|(begin, end)| end - begin)).collect())
}
