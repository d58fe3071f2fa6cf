//! Devices on which tests run kernels.

use std::sync::{Arc, Mutex, PoisonError};

use kdray::gpu::{Context, ContextOptions, Device, DeviceOverrides};

/// The devices that `pretended` has opened in this process. One that nobody else holds is free.
static OPENED: Mutex<Vec<(DeviceOverrides, Arc<Context>)>> = Mutex::new(Vec::new());

/// Returns a device under validation that no other test uses while this one does. An earlier test may have used it,
/// and the driver does not compile again what it compiled then: with software drivers the tests would spend most of
/// their time on that.
pub fn device() -> Arc<Context> {
    pretended(DeviceOverrides::default())
}

/// Does what [`device`] does, for a device that kdray takes for what the overrides make of it.
pub fn pretended(overrides: DeviceOverrides) -> Arc<Context> {
    let mut opened = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    // A device that has messages may be in a state that would fail another test. Messages may come as long as a test
    // holds the device, so they are looked at again when it is free.
    opened.retain(|(_, context)| Arc::strong_count(context) > 1 || context.validation_messages().is_empty());
    let is_free = |(theirs, context): &&(DeviceOverrides, Arc<Context>)| {
        *theirs == overrides && Arc::strong_count(context) == 1 && context.validation_messages().is_empty()
    };
    if let Some((_, free)) = opened.iter().find(is_free) {
        return free.clone();
    }
    let context = open(overrides);
    opened.push((overrides, context.clone()));
    context
}

fn open(overrides: DeviceOverrides) -> Arc<Context> {
    let options = ContextOptions { overrides, ..ContextOptions::new(None, true) };
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
