//! Kernels that trace the same rays on a device, timed in turn.

use std::{rc::Rc, sync::Arc};

use crate::{
    buffers::CastResources,
    gpu::{Access, CommandBuffer, Commands, Context, GpuError, Timer},
};

/// One way of tracing rays that are on the device.
pub trait Contender {
    /// The name in reports.
    fn name(&self) -> String;

    /// How it touches rays and hits.
    fn access(&self) -> Access;

    /// One pass. Needs cast_rays; leaves cast_hits, one a ray.
    fn record(&self, commands: &Commands);

    /// Its rays and hits; contenders may share them.
    fn resources(&self) -> &Rc<CastResources>;
}

/// Milliseconds of each contender in each of `n_rounds`, after a round that is not counted: what ran before has left
/// caches and clocks as it needs them.
pub(crate) fn rounds(
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
    context.submit(&buffers.iter().collect::<Vec<_>>())?;
    context.wait()?;
    let rows = timer.rows()?;
    assert_eq!(rows.len(), n_passes, "a contender is one pass");
    Ok(rows[contenders.len()..].iter().map(|row| row.span_ms.map(|(begin, end)| end - begin)).collect())
}
