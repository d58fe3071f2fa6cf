//! How a section of the frame's plan is recorded: each pass by its own file, each barrier by its accesses.

use super::Passes;
use crate::{
    buffers::Resources,
    frame::{Pass, Step, Touch},
    gpu::{Access, Commands},
    layout::{Batch, FalseColor},
};

/// What passes are told beside their resources.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inputs {
    /// The rays to work on, for passes of a batch or bounce.
    pub batch: Batch,
    /// The feature to display, for [`Pass::FalseColor`].
    pub false_color: Option<FalseColor>,
}

impl Passes {
    /// Records passes and the barriers between them. The resources have to be bound.
    pub fn record_section(&self, commands: &Commands, resources: &Resources, section: &[Step], inputs: &Inputs) {
        for step in section {
            match *step {
                Step::Run(pass) => self.record(commands, resources, pass, inputs),
                Step::Barrier { before, after, .. } => commands.barrier(access(before), access(after)),
            }
        }
    }

    /// Records one pass. The resources have to be bound.
    ///
    /// # Panics
    /// The passes were made for options that do not have this one, or it lacks its input.
    pub fn record(&self, commands: &Commands, resources: &Resources, pass: Pass, inputs: &Inputs) {
        let batch = &inputs.batch;
        match pass {
            Pass::Visibility => self.visibility().record(commands, resources),
            Pass::RasterizeTriangles => self.rasterize().triangles(commands, resources),
            Pass::RasterizeBlocks => self.rasterize().blocks(commands, resources),
            Pass::PrimaryHit => self.primary_hit.record(commands, batch),
            Pass::Trace => self.trace.record(commands, resources, batch),
            Pass::Features => self.features.record(commands, batch),
            Pass::CompactReduce => self.compact.reduce(commands, resources, batch),
            Pass::CompactSpine => self.compact.spine(commands, batch),
            Pass::CompactScatter => self.compact.scatter(commands, resources, batch),
            Pass::Shadow => self.shadow.record(commands, resources, batch),
            Pass::Shade => self.shade.record(commands, resources, batch),
            Pass::Resolve => self.resolve.record(commands, batch),
            Pass::Accumulate => self.accumulate.record(commands, resources),
            Pass::Denoise => self.denoise.record(commands, resources),
            Pass::FalseColor => {
                let push = inputs.false_color.as_ref().expect("a feature is displayed");
                self.false_color.record(commands, resources, push);
            }
            Pass::Tonemap => self.tonemap.record(commands, resources),
        }
    }
}

/// The device's word for how kernels touch memory.
fn access(touch: Touch) -> Access {
    match touch {
        Touch::Read => Access::ComputeRead,
        Touch::Write => Access::ComputeWrite,
        Touch::Update => Access::ComputeUpdate,
        Touch::Indirect => Access::IndirectRead,
    }
}
