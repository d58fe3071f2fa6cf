//! Ways of tracing the same rays that take turns on a device.

use std::sync::Arc;

use crate::{
    bench::{
        Spread,
        traversal::{CASTS_A_TURN, turns},
        warm_up,
    },
    cast::{Contender, rounds},
    gpu::{Access, Context, GpuError},
    layout::Hit,
};

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
