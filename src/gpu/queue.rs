//! Queues: submissions, what they keep alive until the device has ended them, and presentation.
//!
//! One lock guards each queue, as Vulkan demands. It is held while work is handed to the driver, never while somebody
//! waits for the device: each submission has a fence of its own, so threads wait for their own work alone.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU32, Ordering},
    },
    thread,
    time::Duration,
};

use ash::{prelude::VkResult, vk};

use super::{
    CommandBuffer, GpuError,
    lock::{Guard, Rank, lock_anyway},
    raw_device::RawDevice,
};

/// Time between two looks at a fence under validation.
const POLLING_INTERVAL: Duration = Duration::from_micros(100);

/// A queue of the device. It is shared by all threads.
pub(super) struct Queue {
    state: Mutex<State>,
    /// The lock of an external queue, under which all users of the queue submit.
    external_lock: Option<Arc<Mutex<()>>>,
    /// Greatest number of submissions that were in flight at once.
    most_in_flight: AtomicU32,
    device: Arc<RawDevice>,
}

struct State {
    raw: vk::Queue,
    /// In the order of submission, in which the queue's fences are signalled.
    in_flight: VecDeque<InFlight>,
    /// Fences that are not signalled and that nothing waits for.
    free_fences: Vec<Fence>,
}

/// A submission that the device may still work on, with all that it reads and writes.
struct InFlight {
    fence: Arc<Fence>,
    _commands: Vec<CommandBuffer>,
}

struct Fence {
    raw: vk::Fence,
    device: Arc<RawDevice>,
}

/// Work that has been submitted. Whoever drops it without a wait only loses the means to wait for it: the queue keeps
/// what the device reads until the work has ended.
#[must_use]
pub struct Submission(Arc<Fence>);

impl Queue {
    pub fn new(device: Arc<RawDevice>, raw: vk::Queue, external_lock: Option<Arc<Mutex<()>>>) -> Self {
        let state = State { raw, in_flight: VecDeque::new(), free_fences: Vec::new() };
        Self { state: Mutex::new(state), external_lock, most_in_flight: AtomicU32::new(0), device }
    }

    /// Submits command buffers, and keeps them until the device has ended them. The semaphores and
    /// command buffers that `submit_infos` name must belong to the device, and the command buffers to `commands`.
    pub fn submit(
        &self,
        submit_infos: &[vk::SubmitInfo2],
        commands: Vec<CommandBuffer>,
    ) -> Result<Submission, GpuError> {
        let names = || commands.iter().map(CommandBuffer::name).collect::<Vec<_>>().join(", ");
        if self.is_lost() {
            return Err(GpuError::call("vkQueueSubmit2", &names())(vk::Result::ERROR_DEVICE_LOST));
        }
        let mut state = self.lock();
        let fence = match state.free_fences.pop() {
            Some(fence) => fence,
            None => Fence::new(&self.device)?,
        };
        let submitted = {
            let _external = self.lock_external();
            // SAFETY: the locks are held, nothing waits for the fence, and the commands stay in `in_flight` until the
            // fence is signalled.
            unsafe { self.device.raw.queue_submit2(state.raw, submit_infos, fence.raw) }
        };
        if let Err(result) = self.note(submitted) {
            // The fence of a submission that failed is as it was, but for a lost device.
            state.free_fences.push(fence);
            return Err(GpuError::call("vkQueueSubmit2", &names())(result));
        }
        let fence = Arc::new(fence);
        state.in_flight.push_back(InFlight { fence: Arc::clone(&fence), _commands: commands });
        self.most_in_flight.fetch_max(state.in_flight.len() as u32, Ordering::Relaxed);
        Ok(Submission(fence))
    }

    /// Waits until the device has ended a submission, and releases what ended submissions have kept.
    pub fn wait_for(&self, submission: Submission) -> Result<(), GpuError> {
        let waited = match self.device.instance.validates() {
            true => self.wait_between_submissions(&submission.0),
            false => submission.0.wait_at_most(u64::MAX),
        };
        drop(submission);
        let waited = self.note(waited).map_err(GpuError::call("vkWaitForFences", &self.device.info.name));
        self.release_ended();
        waited
    }

    /// Waits for a fence so that the wait ends while nobody submits: validation layers of 2023 forget a wait that ends
    /// during a submission, and report hazards that are none (Vulkan-ValidationLayers #7250).
    fn wait_between_submissions(&self, fence: &Fence) -> VkResult<()> {
        loop {
            let held = self.lock();
            let waited = fence.wait_at_most(0);
            drop(held);
            if waited != Err(vk::Result::TIMEOUT) {
                return waited;
            }
            thread::sleep(POLLING_INTERVAL);
        }
    }

    /// Waits until the device has ended all that was submitted before.
    pub fn wait_for_all(&self) -> Result<(), GpuError> {
        let last = self.lock().in_flight.back().map(|last| Submission(Arc::clone(&last.fence)));
        last.map_or(Ok(()), |last| self.wait_for(last))
    }

    /// Waits until the queue is idle, which includes the presentation of pictures, whose end no fence tells.
    pub fn wait_for_presentation(&self) -> Result<(), GpuError> {
        self.wait_for_all()?;
        let _state = self.lock();
        let _external = self.lock_external();
        // SAFETY: the lock is held. Another queue is used only where nothing is presented, and not any more while the
        // context is dropped.
        self.note(unsafe { self.device.raw.device_wait_idle() }).map_err(GpuError::call("vkDeviceWaitIdle", "kdray"))
    }

    /// Calls `present`, which presents a picture, with the queue.
    #[cfg(feature = "view")]
    pub fn present<T>(&self, present: impl FnOnce(vk::Queue) -> VkResult<T>) -> VkResult<T> {
        self.note(self.with_raw(present))
    }

    /// Calls a function with the queue, which nobody else uses meanwhile.
    #[cfg(feature = "view")]
    pub fn with_raw<T>(&self, call: impl FnOnce(vk::Queue) -> T) -> T {
        let state = self.lock();
        let _external = self.lock_external();
        call(state.raw)
    }

    /// Notes if a call has found the device lost.
    fn note<T>(&self, result: VkResult<T>) -> VkResult<T> {
        if matches!(result, Err(vk::Result::ERROR_DEVICE_LOST)) {
            self.device.is_lost.store(true, Ordering::Relaxed);
        }
        result
    }

    /// Whether a call of any queue has found the device lost.
    pub fn is_lost(&self) -> bool {
        self.device.is_lost.load(Ordering::Relaxed)
    }

    /// Returns the greatest number of submissions that were in flight at once.
    pub fn most_in_flight(&self) -> u32 {
        self.most_in_flight.load(Ordering::Relaxed)
    }

    /// Takes the queue's lock. The state is complete even if a thread has panicked: each change of it is one call.
    fn lock(&self) -> Guard<'_, State> {
        lock_anyway(Rank::Queue, &self.state)
    }

    fn lock_external(&self) -> Option<Guard<'_, ()>> {
        self.external_lock.as_ref().map(|external| lock_anyway(Rank::ExternalQueue, external))
    }

    /// Releases the submissions that the device has ended.
    fn release_ended(&self) {
        let ended: Vec<_> = {
            let mut state = self.lock();
            let n_ended = state.in_flight.iter().take_while(|in_flight| self.has_ended(&in_flight.fence)).count();
            state.in_flight.drain(..n_ended).collect()
        };
        // What submissions keep is released without the lock. Their fences serve again unless somebody still waits.
        let fences: Vec<_> = ended.into_iter().filter_map(|InFlight { fence, .. }| Arc::into_inner(fence)).collect();
        let raw: Vec<_> = fences.iter().map(|fence| fence.raw).collect();
        // SAFETY: the fences are signalled, and nobody else has them.
        if !raw.is_empty() && unsafe { self.device.raw.reset_fences(&raw) }.is_ok() {
            self.lock().free_fences.extend(fences);
        }
    }

    fn has_ended(&self, fence: &Fence) -> bool {
        // SAFETY: the fence is alive.
        match self.note(unsafe { self.device.raw.get_fence_status(fence.raw) }) {
            Ok(is_signalled) => is_signalled,
            // A lost device has ended all work.
            Err(result) => result == vk::Result::ERROR_DEVICE_LOST,
        }
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        // An error can be ignored: a device that is lost has ended all work. No other thread has the queue any more.
        // Other queues of an external device may work on, for which kdray must not wait.
        let _ = if self.device.is_external { self.wait_for_all() } else { self.wait_for_presentation() };
    }
}

impl Fence {
    fn new(device: &Arc<RawDevice>) -> Result<Self, GpuError> {
        // SAFETY: the call only creates a fence, which `Drop` destroys.
        let raw = unsafe { device.raw.create_fence(&vk::FenceCreateInfo::default(), None) }
            .map_err(GpuError::call("vkCreateFence", "submission"))?;
        Ok(Self { raw, device: Arc::clone(device) })
    }

    /// Waits until the fence is signalled, or fails with `TIMEOUT`.
    fn wait_at_most(&self, nanoseconds: u64) -> VkResult<()> {
        // SAFETY: the fence is alive, and the queue resets only fences that nobody else has.
        unsafe { self.device.raw.wait_for_fences(&[self.raw], true, nanoseconds) }
    }
}

impl Drop for Fence {
    fn drop(&mut self) {
        // SAFETY: the fence is signalled or was never submitted: the queue holds all others.
        unsafe { self.device.raw.destroy_fence(self.raw, None) };
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ContextOptions, Device};
    use ash::vk;

    #[test]
    fn every_handle_sees_a_lost_device() {
        let device = Device::open(&ContextOptions::new(None, true)).expect("a device with validation");
        let (context, clone) = (device.inner(), device.clone());
        context.run("before", |_| ()).expect("the device works");
        assert!(!clone.is_lost());
        // What a driver answers to the call of one thread.
        assert!(context.queue.note(Err::<(), _>(vk::Result::ERROR_DEVICE_LOST)).is_err());
        assert!(clone.is_lost());
        let error = clone.inner().run("after", |_| ()).expect_err("no work is begun");
        assert!(error.is_device_lost(), "{error}");
        assert_eq!(device.validation_messages(), Vec::<String>::new());
    }
}
