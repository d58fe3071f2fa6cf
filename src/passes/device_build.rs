//! What the builds of grids and kd-trees on a device have in common: their reports, and copies of arrays.

use std::sync::Arc;

use crate::{
    accel::{BuildStage, DeviceBuild, Statistics},
    gpu::{Access, AnyBuffer, Context, GpuError, TimerRow},
};

/// Returns the report of a build. `rows`: its dispatches in order; none without timestamps.
pub fn report(statistics: Statistics, rows: &[TimerRow]) -> DeviceBuild {
    let span = |row: &TimerRow| row.span_ms;
    let begin = rows.first().and_then(span).map(|(begin, _)| begin);
    let end = rows.last().and_then(span).map(|(_, end)| end);
    DeviceBuild { statistics, ms: begin.zip(end).map(|(begin, end)| end - begin), stages: stages_of(rows) }
}

/// Returns the sum of the times of all rows of a name, for each name in the order in which it first occurs.
fn stages_of(rows: &[TimerRow]) -> Vec<BuildStage> {
    let mut stages: Vec<BuildStage> = Vec::new();
    for row in rows {
        BuildStage { name: row.name, ms: row.span_ms.map(|(begin, end)| end - begin) }.add_to(&mut stages);
    }
    stages
}

/// Fills arrays from the beginnings of those of a finished build, and waits for the device. `name`: that of the command
/// buffer.
///
/// # Errors
/// Out of memory; a Vulkan call fails.
pub fn copy(
    context: &Arc<Context>,
    name: &str,
    arrays: &[(&Arc<AnyBuffer>, &Arc<AnyBuffer>, usize)],
) -> Result<(), GpuError> {
    context.run(name, |commands| {
        commands.barrier(Access::ComputeWrite, Access::TransferRead); // the build's arrays
        for (from, to, bytes) in arrays.iter().filter(|(.., bytes)| *bytes > 0) {
            commands.copy_buffer(from, to, *bytes as u64);
        }
        commands.barrier(Access::TransferWrite, Access::AnyUse); // the copies
    })
}
