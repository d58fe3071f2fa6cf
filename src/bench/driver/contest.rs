//! A contest of tracers (contenders) that take turns with the same rays on a device.

use std::sync::Arc;

use crate::{
    bench::{
        Spread,
        traversal::{CASTS_PER_TURN, turns},
        warm_up,
    },
    cast::{Contender, time_in_turn},
    gpu::{Access, Context, GpuError},
    layout::Hit,
};

/// The result of one contender.
#[derive(Clone, Debug, PartialEq)]
pub struct ContenderResult {
    pub name: String,
    /// Time of all rays; none where the device has no timestamps.
    pub ms: Option<Spread>,
    /// One hit per ray.
    pub hits: Vec<Hit>,
}

/// A hit that no tracer writes. It marks rays whose hit was not written.
const UNWRITTEN: Hit = Hit { t: f32::NAN, triangle_ix: 0, u: 0.0, v: 0.0 };

/// Runs `n_times` timed rounds, in each of which every contender traces its rays once. After every few rounds,
/// `between` is called with the number of rounds since its last call. At the end, each contender traces its rays once
/// more, untimed, and its hits are downloaded.
///
/// # Errors
/// The device is out of memory, or a call of Vulkan fails.
pub fn run_contest(
    context: &Arc<Context>,
    contenders: &[Box<dyn Contender>],
    n_times: u16,
    mut between: impl FnMut(u16) -> Result<(), GpuError>,
) -> Result<Vec<ContenderResult>, GpuError> {
    if n_times > 0 {
        warm_up(|| time_in_turn(context, contenders, CASTS_PER_TURN).map(drop))?;
    }
    let mut all_ms = vec![Vec::new(); contenders.len()];
    for n_rounds in turns(n_times) {
        let rows = time_in_turn(context, contenders, n_rounds)?;
        for (row_ix, ms) in rows.into_iter().enumerate() {
            all_ms[row_ix % contenders.len()].extend(ms);
        }
        between(n_rounds)?;
    }
    let trial = |contender: &dyn Contender, ms| {
        Ok(ContenderResult { name: contender.name(), ms: Spread::of(ms), hits: hits_of(context, contender)? })
    };
    contenders.iter().zip(all_ms).map(|(contender, ms)| trial(contender.as_ref(), ms)).collect()
}

/// Returns the hits of one contender. The buffer is overwritten first, so that no hit of another contender remains.
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
