//! Memory through which the host gives a kernel its inputs and gets the outputs back, run after run.

use std::{slice, sync::Arc};

use bytemuck::Pod;
use gpu_allocator::MemoryLocation;

use super::{Access, AnyBuffer, Binding, BufferUse, Commands, Context, GpuError, buffer::Staging};

/// Mapped memory of inputs of a kernel, and of its outputs. A run ends before the host sees the memory again. After a
/// run that has failed, a copy of the inputs may not have ended: then no other run may follow.
pub struct Exchange {
    inputs: Staging,
    /// Number of bytes of the inputs that the host may have written.
    filled: u64,
    /// The device's copy of the inputs, if kernels do not read the mapped memory itself.
    copy: Option<Arc<AnyBuffer>>,
    outputs: Staging,
    context: Arc<Context>,
}

impl Exchange {
    /// Creates memory with undefined contents. `names` and `bytes`: of the inputs and of the outputs. `by_copies`:
    /// whether a queue for copies takes the inputs to the device, if there is one. Otherwise the host or the kernel
    /// does.
    ///
    /// # Errors
    /// A buffer exceeds the device's limits, or memory is exhausted.
    pub fn new(context: &Arc<Context>, names: [&str; 2], bytes: [usize; 2], by_copies: bool) -> Result<Self, GpuError> {
        // The host only writes inputs, in order, so that without copies their memory may be write-combined. On devices
        // whose whole memory is mapped, it is the device's own. The host reads outputs, so their memory has to be
        // cached.
        let is_copied = by_copies && context.copies_inputs();
        let location = if is_copied { MemoryLocation::GpuToCpu } else { MemoryLocation::CpuToGpu };
        let inputs = mapped(context, names[0], bytes[0], location)?;
        let copy = || AnyBuffer::on_device(context, names[0], inputs.buffer().bytes(), BufferUse::Input, 4);
        let copy = is_copied.then(copy).transpose()?.map(Arc::new);
        let outputs = mapped(context, names[1], bytes[1], MemoryLocation::GpuToCpu)?;
        Ok(Self { inputs, filled: 0, copy, outputs, context: Arc::clone(context) })
    }

    /// Returns the bytes of the memory of inputs, and of that of outputs.
    pub fn bytes(&self) -> [usize; 2] {
        [&self.inputs, &self.outputs].map(|staging| staging.buffer().bytes() as usize)
    }

    /// Returns the storage buffers that kernels read inputs from and write outputs to. Only the commands of a run, and
    /// those that its `finish` waits for, may use them.
    pub(crate) fn bindings(&self) -> [Binding<'_>; 2] {
        [Binding::Buffer(self.copy.as_ref().unwrap_or(self.inputs.buffer())), Binding::Buffer(self.outputs.buffer())]
    }

    /// Returns the memory of the first `n` inputs. To read it is slow, and so is any order of writing but the elements'
    /// own.
    ///
    /// # Panics
    /// There is room for fewer.
    pub fn inputs<I: Pod>(&mut self, n: usize) -> &mut [I] {
        let at = first::<I>(&self.inputs, n);
        self.filled = (n * size_of::<I>()) as u64;
        // SAFETY: the memory holds `n` elements, which any bytes are, and stays mapped as long as its owner. The host
        // accesses it through this borrow alone. A device that still reads it, because a wait has failed, at most
        // computes outputs that nobody gets.
        unsafe { slice::from_raw_parts_mut(at, n) }
    }

    /// Runs what `record` records, and returns the first `n` outputs. `finish` is called after the device has ended the
    /// commands. It says whether it has run more commands that write outputs, and has waited for them.
    ///
    /// # Errors
    /// `finish` fails, memory is exhausted, or a call fails.
    ///
    /// # Panics
    /// There is room for fewer.
    pub fn run<O: Pod>(
        &mut self,
        n: usize,
        record: impl FnOnce(&Commands),
        finish: impl FnOnce() -> Result<bool, GpuError>,
    ) -> Result<&[O], GpuError> {
        let outputs = first::<O>(&self.outputs, n);
        // The host's writes before a submission need no barrier.
        if let Some(copy) = self.copy.as_ref().filter(|_| self.filled > 0) {
            self.context.copy_to_input(self.inputs.buffer(), copy, self.filled)?;
        }
        self.context.run("exchange", |commands| {
            if self.copy.is_some() {
                // Inputs. The copies have ended, but what another queue has written is not visible without a barrier.
                commands.barrier(Access::TransferWrite, Access::AnyUse);
            }
            record(commands);
            commands.barrier(Access::ComputeWrite, Access::HostRead); // outputs
        })?;
        if finish()? {
            // The outputs.
            self.context.run("exchange", |commands| commands.barrier(Access::ComputeWrite, Access::HostRead))?;
        }
        // SAFETY: the memory holds `n` elements, which any bytes are, and stays mapped as long as its owner. The device
        // has ended this run and all before, even if their waits have failed: a wait includes all that was submitted
        // before. The next run borrows this value mutably.
        Ok(unsafe { slice::from_raw_parts(outputs, n) })
    }
}

/// Returns the address of `n` elements, which the memory has room for.
fn first<T: Pod>(memory: &Staging, n: usize) -> *mut T {
    const { assert!(align_of::<T>() <= 16, "mapped memory begins at a multiple of 16") };
    let (name, bytes) = (memory.buffer().name(), memory.buffer().bytes());
    let has_room = n.checked_mul(size_of::<T>()).is_some_and(|needed| needed as u64 <= bytes);
    assert!(has_room, "`{name}` has {bytes} bytes, too few for {n} elements");
    memory.mapped().cast().as_ptr()
}

/// Makes storage of `bytes` in mapped memory.
fn mapped(context: &Arc<Context>, name: &str, bytes: usize, location: MemoryLocation) -> Result<Staging, GpuError> {
    let bytes = bytes.max(1) as u64;
    let limit = context.limits().storage_range;
    if bytes > limit {
        return Err(GpuError::TooLarge { object: name.to_owned(), bytes, limit });
    }
    Staging::new(context, name, bytes, location)
}

#[cfg(test)]
mod tests {
    use super::{
        super::{ContextOptions, DeviceOverrides},
        *,
    };

    /// What stands for a kernel copies inputs to outputs.
    #[test]
    fn outputs_are_those_of_the_last_commands() {
        for by_copies in [false, true] {
            outputs_follow_inputs(by_copies);
        }
    }

    fn outputs_follow_inputs(by_copies: bool) {
        let overrides = DeviceOverrides { copies_inputs: true, ..Default::default() };
        let options = ContextOptions { for_streams: true, overrides, ..ContextOptions::new(None, true) };
        let context = Context::new(&options).expect("a device with validation");
        let mut exchange = Exchange::new(&context, ["in", "out"], [400, 400], by_copies).expect("buffers");
        assert_eq!(exchange.copy.is_some(), by_copies);
        let [Binding::Buffer(inputs), Binding::Buffer(outputs)] = exchange.bindings() else { panic!("no buffers") };
        let (inputs, outputs) = (Arc::clone(inputs), Arc::clone(outputs));
        let fence = |commands: &Commands| commands.barrier(Access::TransferWrite, Access::AnyUse);
        for n in [100, 3, 0, 50] {
            let expected: Vec<u32> = (0..n as u32).map(|ix| ix ^ n as u32).collect();
            exchange.inputs(n).copy_from_slice(&expected);
            let copy = |commands: &Commands| {
                if !by_copies {
                    fence(commands);
                }
                commands.copy_buffer(&inputs, &outputs, 400);
                fence(commands);
            };
            assert_eq!(exchange.run::<u32>(n, copy, || Ok(false)).expect("a run"), expected);
            let fill = |commands: &Commands| {
                commands.fill_buffer(&outputs, 7);
                fence(commands);
            };
            let found = exchange.run::<u32>(n, copy, || context.run("more", fill).map(|()| true)).expect("a run");
            assert_eq!(found, vec![7; n]);
        }
        assert_eq!(context.validation_messages(), Vec::<String>::new());
    }
}
