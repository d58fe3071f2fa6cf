//! Ways of tracing the same rays that take turns on a device.

use std::{rc::Rc, sync::Arc};

use crate::{
    bench::{
        Spread,
        traversal::{CASTS_A_TURN, turns},
        warm_up,
    },
    buffers::CastResources,
    gpu::{Access, CommandBuffer, Commands, Context, GpuError, Timer},
    layout::Hit,
};

/// One way of tracing rays that are on the device.
pub trait Contender {
    fn name(&self) -> String;

    /// How it touches rays and hits.
    fn access(&self) -> Access;

    /// One pass. Needs cast_rays; leaves cast_hits, one a ray.
    fn record(&self, commands: &Commands);

    /// Its rays and hits; contenders may share them.
    fn resources(&self) -> &Rc<CastResources>;
}

/// What became of a contender.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    pub name: String,
    /// Of all rays; none where the device has no timestamps.
    pub ms: Option<Spread>,
    /// One a ray.
    pub hits: Vec<Hit>,
}

/// No tracer leaves such a hit: where it is found, none was written.
const UNWRITTEN: Hit = Hit { t: f32::NAN, triangle_ix: 0, u: 0.0, v: 0.0 };

/// Lets each trace its rays `n_times`, one after the other again and again, and fetches their hits. `between` has its
/// turn whenever they pause, with the number of rounds that were timed since the last pause.
///
/// # Errors
/// Out of memory, a failed call.
pub fn hold(
    context: &Arc<Context>,
    contenders: &[Box<dyn Contender>],
    n_times: u16,
    mut between: impl FnMut(u16) -> Result<(), GpuError>,
) -> Result<Vec<Trial>, GpuError> {
    if n_times > 0 {
        warm_up(|| rounds(context, contenders, CASTS_A_TURN).map(drop))?;
    }
    let mut all_ms = vec![Vec::new(); contenders.len()];
    for n_rounds in turns(n_times) {
        let rows = rounds(context, contenders, n_rounds)?;
        for (row_ix, ms) in rows.into_iter().enumerate() {
            all_ms[row_ix % contenders.len()].extend(ms);
        }
        between(n_rounds)?;
    }
    let trial = |contender: &dyn Contender, ms| {
        Ok(Trial { name: contender.name(), ms: Spread::of(ms), hits: hits_of(context, contender)? })
    };
    contenders.iter().zip(all_ms).map(|(contender, ms)| trial(contender.as_ref(), ms)).collect()
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

/// What it finds, and nothing that another has found before.
fn hits_of(context: &Arc<Context>, contender: &dyn Contender) -> Result<Vec<Hit>, GpuError> {
    let hits = &contender.resources().cast_hits;
    hits.upload(&vec![UNWRITTEN; hits.len()])?;
    context.run(&contender.name(), |commands| {
        commands.barrier(Access::TransferWrite, contender.access()); // cast_hits
        contender.record(commands);
        commands.barrier(contender.access(), Access::TransferRead); // cast_hits
    })?;
    hits.download()
}
