//! Memory through which the host gives a kernel its inputs and gets the outputs back, run after run.

use std::{marker::PhantomData, slice, sync::Arc};

use bytemuck::Pod;
use gpu_allocator::MemoryLocation;

use super::{Access, Binding, Commands, Context, GpuError, buffer::Staging};

/// Mapped memory of `len` inputs of a kernel, and of as many outputs. A run ends before the host sees the memory again.
pub struct Exchange<I, O> {
    inputs: Staging,
    outputs: Staging,
    elements: PhantomData<(I, O)>,
    len: usize,
    context: Arc<Context>,
}

impl<I: Pod, O: Pod> Exchange<I, O> {
    /// Creates memory with undefined contents. `names`: of the inputs and of the outputs.
    ///
    /// # Errors
    /// A buffer exceeds the device's limits, or memory is exhausted.
    pub fn new(context: &Arc<Context>, names: [&str; 2], len: usize) -> Result<Self, GpuError> {
        // The host only writes inputs, in order, so their memory may be write-combined. On devices whose whole memory
        // is mapped, it is the device's own. The host reads outputs, so their memory has to be cached.
        let inputs = mapped::<I>(context, names[0], len, MemoryLocation::CpuToGpu)?;
        let outputs = mapped::<O>(context, names[1], len, MemoryLocation::GpuToCpu)?;
        Ok(Self { inputs, outputs, elements: PhantomData, len, context: Arc::clone(context) })
    }

    /// Returns the number of inputs for which there is room.
    pub fn room(&self) -> usize {
        self.len
    }

    /// Returns the storage buffers that kernels read inputs from and write outputs to. Only the commands of a run, and
    /// those that its `finish` waits for, may use them.
    pub(crate) fn bindings(&self) -> [Binding<'_>; 2] {
        [Binding::Buffer(self.inputs.buffer()), Binding::Buffer(self.outputs.buffer())]
    }

    /// Returns the memory of inputs. To read it is slow, and so is any order of writing but the elements' own.
    pub fn inputs(&mut self) -> &mut [I] {
        // SAFETY: the memory holds `len` elements, which any bytes are, and stays mapped as long as its owner. The host
        // accesses it through this borrow alone. A device that still reads it, because a wait has failed, at most
        // computes outputs that nobody gets.
        unsafe { slice::from_raw_parts_mut(self.inputs.mapped().cast().as_ptr(), self.len) }
    }

    /// Runs what `record` records on the first `n` inputs, and returns their outputs. `finish` is called after the
    /// device has ended the commands. It says whether it has run more commands that write outputs, and has waited for
    /// them.
    ///
    /// # Errors
    /// `finish` fails, memory is exhausted, or a call fails.
    ///
    /// # Panics
    /// There is room for fewer.
    pub fn run(
        &mut self,
        n: usize,
        record: impl FnOnce(&Commands),
        finish: impl FnOnce() -> Result<bool, GpuError>,
    ) -> Result<&[O], GpuError> {
        assert!(n <= self.len, "`{}` has room for {} elements, not {n}", self.inputs.buffer().name(), self.len);
        // The host's writes before a submission need no barrier.
        self.context.run("exchange", |commands| {
            record(commands);
            commands.barrier(Access::ComputeWrite, Access::HostRead); // outputs
        })?;
        if finish()? {
            // The outputs.
            self.context.run("exchange", |commands| commands.barrier(Access::ComputeWrite, Access::HostRead))?;
        }
        // SAFETY: the memory holds `len` elements, which any bytes are, and stays mapped as long as its owner. The
        // device has ended this run and all before, even if their waits have failed: a wait includes all that was
        // submitted before. The next run borrows this value mutably.
        Ok(unsafe { slice::from_raw_parts(self.outputs.mapped().cast().as_ptr(), n) })
    }
}

/// Makes storage for `len` elements in mapped memory.
fn mapped<T: Pod>(
    context: &Arc<Context>,
    name: &str,
    len: usize,
    location: MemoryLocation,
) -> Result<Staging, GpuError> {
    let bytes = (len.max(1) * size_of::<T>()) as u64;
    let limit = context.limits().storage_range;
    if bytes > limit {
        return Err(GpuError::TooLarge { object: name.to_owned(), bytes, limit });
    }
    Staging::new(context, name, bytes, location)
}

#[cfg(test)]
mod tests {
    use super::{super::ContextOptions, *};

    /// What stands for a kernel copies inputs to outputs.
    #[test]
    fn outputs_are_those_of_the_last_commands() {
        let context = Context::new(&ContextOptions::new(None, true)).expect("a device with validation");
        let mut exchange = Exchange::<u32, u32>::new(&context, ["in", "out"], 100).expect("buffers");
        let [inputs, outputs] = [&exchange.inputs, &exchange.outputs].map(|it| it.buffer().clone());
        let fence = |commands: &Commands| commands.barrier(Access::TransferWrite, Access::AnyUse);
        for n in [100, 3, 0, 50] {
            let expected: Vec<u32> = (0..n as u32).map(|ix| ix ^ n as u32).collect();
            exchange.inputs()[..n].copy_from_slice(&expected);
            let copy = |commands: &Commands| {
                fence(commands);
                commands.copy_buffer(&inputs, &outputs, 400);
                fence(commands);
            };
            assert_eq!(exchange.run(n, copy, || Ok(false)).expect("a run"), expected);
            let fill = |commands: &Commands| {
                commands.fill_buffer(&outputs, 7);
                fence(commands);
            };
            let found = exchange.run(n, copy, || context.run("more", fill).map(|()| true)).expect("a run");
            assert_eq!(found, vec![7; n]);
        }
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }
}
