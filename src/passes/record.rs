//! Records a sequence of the frame's plan. The functions in a pass's file record the pass. A barrier is recorded by
//! its accesses alone, without its resources.

use super::Passes;
use crate::{
    buffers::Resources,
    frame::{self, Pass, PlanEntry},
    gpu::{Access, Commands},
    layout::{Batch, FalseColor},
};

/// The inputs of passes beside their resources.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inputs {
    /// The rays that passes of a batch or of a bounce work on.
    pub batch: Batch,
    /// The AOVs that [`Pass::FalseColor`] displays.
    pub false_color: Option<FalseColor>,
}

impl Inputs {
    /// Returns the AOVs that [`Pass::FalseColor`] displays.
    ///
    /// # Panics
    /// There is none.
    pub(super) fn displayed_aovs(&self) -> &FalseColor {
        self.false_color.as_ref().expect("an AOV is displayed")
    }
}

impl Passes {
    /// Records passes and the barriers between them. The resources must be bound.
    pub fn record_sequence(&self, commands: &Commands, resources: &Resources, sequence: &[PlanEntry], inputs: &Inputs) {
        record_entries(commands, sequence, |pass, _| self.record(commands, resources, pass, inputs));
    }

    /// Records one pass. The resources must be bound.
    ///
    /// # Panics
    /// The passes were created for options that do not have `pass`, or `inputs` lacks the AOVs that it displays.
    pub fn record(&self, commands: &Commands, resources: &Resources, pass: Pass, inputs: &Inputs) {
        let batch = &inputs.batch;
        match pass {
            Pass::Visibility => self.visibility().record(commands, resources),
            Pass::RasterizeTriangles => self.rasterize().triangles(commands, resources),
            Pass::RasterizeBlocks => self.rasterize().blocks(commands, resources),
            Pass::PrimaryHit => self.primary_hit.record(commands, batch),
            Pass::Trace => self.trace.record(commands, resources, batch),
            Pass::PixelAovs => self.pixel_aovs.record(commands, batch),
            Pass::SurfaceLayers => {
                self.surface_layers.as_ref().expect("the options ask for these layers").record(commands, batch);
            }
            Pass::CompactReduce => self.compact.reduce(commands, resources, batch),
            Pass::CompactSpine => self.compact.spine.record(commands, batch),
            Pass::CompactScatter => self.compact.scatter(commands, resources, batch),
            Pass::Shadow => self.shadow.record(commands, resources, batch),
            Pass::Shade => self.shade.record(commands, resources, batch),
            Pass::Resolve => self.resolve.record(commands, batch),
            Pass::Accumulate => self.accumulate.record(commands, resources),
            Pass::Denoise => self.denoise.record(commands, resources),
            Pass::FalseColor => self.false_color.record(commands, resources, inputs.displayed_aovs()),
            Pass::Tonemap => self.tonemap.record(commands, resources),
            _ => panic!("a frame of ray trees has no `{}`", pass.name()),
        }
    }
}

/// Records the entries of a sequence: passes by `record`, and barriers. `record` also receives how often the sequence
/// has run the pass before.
pub(super) fn record_entries(commands: &Commands, sequence: &[PlanEntry], record: impl Fn(Pass, u32)) {
    for (i, entry) in sequence.iter().enumerate() {
        match *entry {
            PlanEntry::Run(pass) => record(pass, sequence[..i].iter().filter(|before| *before == entry).count() as u32),
            PlanEntry::Barrier { before, after, .. } => commands.barrier(access(before), access(after)),
        }
    }
}

/// Returns the Vulkan access that stands for one of a plan.
fn access(of_plan: frame::Access) -> Access {
    match of_plan {
        frame::Access::Read => Access::ComputeRead,
        frame::Access::Write => Access::ComputeWrite,
        frame::Access::Update => Access::ComputeUpdate,
        frame::Access::Indirect => Access::IndirectRead,
    }
}
