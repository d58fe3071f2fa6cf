//! Reports on the builds of grids and kd-trees on a device.

use crate::{
    accel::{BuildStage, DeviceBuild, Statistics},
    gpu::TimerRow,
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
