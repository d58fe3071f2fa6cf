//! Tests of synchronization validation: it reports each kind of hazard between kernels if a barrier is missing, and
//! none if it is there. Without these tests, the silence of the layer in other tests would prove nothing.

use kdray::{
    frame::plan,
    gpu::{Access, Commands},
    layout::Batch,
    passes::Inputs,
};

use super::stage::{FIRST, Stage, hits_of, options, some_rays};
use crate::support::scenes;

const BATCH: Batch = Batch { n_pixels: 64, ..FIRST };

/// Uploads valid contents, so that a kernel that runs too early does not read arbitrary data.
fn fill(stage: &Stage) {
    let rays = some_rays(stage, 64);
    stage.set_n_rays(&[64]);
    stage.set_rays(&rays);
    stage.set_hits(&hits_of(stage, &rays));
}

/// Runs `first` and `second` with the barrier between them, and without it. Asserts that only the latter causes a
/// message.
fn check(barrier: (Access, Access), first: impl Fn(&Stage, &Commands), second: impl Fn(&Stage, &Commands)) {
    for has_barrier in [true, false] {
        let stage = Stage::new(scenes::mixed(), options(8, 8), 64);
        fill(&stage);
        stage.run(|commands| {
            first(&stage, commands);
            if has_barrier {
                commands.barrier(barrier.0, barrier.1);
            }
            second(&stage, commands);
        });
        stage.expects_messages.set(!has_barrier);
    }
}

fn trace(stage: &Stage, commands: &Commands) {
    stage.passes.trace.record(commands, &stage.resources, &BATCH);
}

fn shadow(stage: &Stage, commands: &Commands) {
    stage.passes.shadow.record(commands, &stage.resources, &BATCH);
}

fn shade(stage: &Stage, commands: &Commands) {
    stage.passes.shade.record(commands, &stage.resources, &BATCH);
}

fn resolve(stage: &Stage, commands: &Commands) {
    stage.passes.resolve.record(commands, &BATCH);
}

fn accumulate(stage: &Stage, commands: &Commands) {
    stage.passes.accumulate.record(commands, &stage.resources);
}

fn compact(stage: &Stage, commands: &Commands) {
    // The sequence's last element, a barrier, is left out.
    let sequence = plan::next_rays();
    let (_, sequence) = sequence.split_last().expect("passes");
    let inputs = Inputs { batch: BATCH, ..Inputs::default() };
    stage.passes.record_sequence(commands, &stage.resources, sequence, &inputs);
}

fn tonemap(stage: &Stage, commands: &Commands) {
    stage.passes.tonemap.record(commands, &stage.resources);
}

fn denoise(stage: &Stage, commands: &Commands) {
    stage.passes.denoise.record(commands, &stage.resources);
}

#[test]
fn reading_hits_before_they_are_written_is_reported() {
    check((Access::ComputeWrite, Access::ComputeUpdate), trace, shadow);
}

#[test]
fn reading_radiance_before_it_is_written_is_reported() {
    check((Access::ComputeWrite, Access::ComputeUpdate), shade, resolve);
}

#[test]
fn reading_rays_before_they_are_made_is_reported() {
    check((Access::ComputeWrite, Access::ComputeUpdate), compact, trace);
}

#[test]
fn overwriting_hits_before_they_are_read_is_reported() {
    check((Access::ComputeUpdate, Access::ComputeUpdate), shade, trace);
}

#[test]
fn filtering_pixels_before_their_mean_is_there_is_reported() {
    check((Access::ComputeWrite, Access::ComputeRead), accumulate, denoise);
}

#[test]
fn showing_pixels_before_they_are_filtered_is_reported() {
    check((Access::ComputeWrite, Access::ComputeRead), denoise, tonemap);
}
