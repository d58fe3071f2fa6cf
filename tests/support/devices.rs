//! Devices on which tests run kernels.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread::{self, ThreadId},
    time::Duration,
};

use kdray::gpu::{Context, ContextOptions, Device, DeviceOverrides};

/// The devices that `pretended` has opened in this process. One that nobody else holds is free.
static OPENED: Mutex<Opened> = Mutex::new(Opened { devices: Vec::new(), waiting: Vec::new() });

struct Opened {
    devices: Vec<OpenedDevice>,
    /// The tests that wait for the others' calls to end.
    waiting: Vec<ThreadId>,
}

struct OpenedDevice {
    overrides: DeviceOverrides,
    context: Arc<Context>,
    /// The test that took it last.
    taker: ThreadId,
}

impl OpenedDevice {
    fn is_held(&self) -> bool {
        Arc::strong_count(&self.context) > 1
    }
}

/// Returns a device under validation that no other test uses while this one does. An earlier test may have used it,
/// and the driver does not compile again what it compiled then: with software drivers the tests would spend most of
/// their time on that.
pub fn device() -> Arc<Context> {
    pretended(DeviceOverrides::default())
}

/// Returns how many of `n` rays may have other hits than on the CPU: none on software drivers, whose arithmetic is
/// exactly the CPU's. Vulkan allows quotients an error of 2.5 units in the last place (OpFDiv). Of rays that aim at
/// corners and edges, begin on triangles, or meet needles edge-on, one in twelve has another hit on an H200.
pub fn n_outliers(context: &Context, n: usize) -> usize {
    if context.is_software() { 0 } else { n.div_ceil(8) }
}

/// Does what [`device`] does, for a device that kdray takes for what the overrides make of it.
///
/// A device is opened or closed only while no other test can call one: the validation layer of Debian 12 (1.3.239)
/// keeps its devices in a map without a lock, and a call that met the change ended in a segmentation fault.
pub fn pretended(overrides: DeviceOverrides) -> Arc<Context> {
    let taker = thread::current().id();
    let mut opened = lock();
    loop {
        let is_free = |device: &&mut OpenedDevice| {
            device.overrides == overrides && !device.is_held() && device.context.validation_messages().is_empty()
        };
        if let Some(free) = opened.devices.iter_mut().find(is_free) {
            free.taker = taker;
            return free.context.clone();
        }
        let may_call = |device: &OpenedDevice| {
            device.is_held() && device.taker != taker && !opened.waiting.contains(&device.taker)
        };
        if !opened.devices.iter().any(may_call) {
            break;
        }
        opened.waiting.push(taker);
        drop(opened);
        thread::sleep(Duration::from_millis(1));
        opened = lock();
        opened.waiting.retain(|&test| test != taker);
    }
    // A device that has messages may be in a state that would fail another test. Messages may come as long as a test
    // holds the device, so they are looked at when it is free.
    opened.devices.retain(|device| device.is_held() || device.context.validation_messages().is_empty());
    let context = open(overrides);
    opened.devices.push(OpenedDevice { overrides, context: context.clone(), taker });
    context
}

fn lock() -> MutexGuard<'static, Opened> {
    OPENED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn open(overrides: DeviceOverrides) -> Arc<Context> {
    let options = ContextOptions { for_streams: true, overrides, ..ContextOptions::new(None, true) };
    let device = Device::open(&options).expect("a device with validation");
    // SAFETY: the tests keep to what the hidden modules state.
    Arc::clone(unsafe { device.context() })
}

/// Returns a device under validation that runs kernels as a GPU of `n_lanes` lanes does.
pub fn with_lanes(n_lanes: u32) -> Arc<Context> {
    pretended(DeviceOverrides { n_lanes: Some(n_lanes), ..DeviceOverrides::default() })
}

/// Returns a device under validation whose kernels have no 64-bit atomics.
pub fn without_wide_atomics() -> Arc<Context> {
    pretended(DeviceOverrides { no_int64_atomics: true, ..DeviceOverrides::default() })
}

pub fn assert_silent(context: &Context) {
    let messages = context.validation_messages();
    assert!(messages.is_empty(), "{} messages: {}", messages.len(), messages.join("\n"));
}
