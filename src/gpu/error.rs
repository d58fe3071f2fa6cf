//! Errors of the Vulkan layer. Each displays as one line, which names the call and the object if a call has failed.

use std::{error, fmt};

use ash::vk;

/// An error that stops a device from doing its work. It displays as one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The machine has no Vulkan loader.
    #[error("no Vulkan loader ({0}); ./setup installs it")]
    NoLoader(String),
    /// The loader finds no driver.
    #[error("no Vulkan driver found; ./setup installs Mesa's lavapipe, which needs no GPU")]
    NoDriver,
    /// No device has the requested index or name.
    #[error("no Vulkan device `{wanted}`; there are: {available}")]
    NoSuchDevice {
        /// The requested index or name.
        wanted: String,
        /// The available devices.
        available: String,
    },
    /// A device lacks a feature, an extension or an ability.
    #[error("device `{device}` lacks {missing}")]
    Lacks {
        /// The device's name.
        device: String,
        /// The missing features, extensions or abilities.
        missing: String,
    },
    /// The machine has no validation layer.
    #[error("no validation layer VK_LAYER_KHRONOS_validation; ./setup installs it")]
    NoValidationLayer,
    /// No picture can be shown in the window. The text says why.
    #[error("cannot show pictures in this window: {0}")]
    NoSurface(String),
    /// A library that kdray uses has failed.
    #[error("{object}: {message}")]
    Other {
        /// What the library was to do or to make.
        object: &'static str,
        /// The library's message.
        message: String,
    },
    /// A Vulkan call has failed.
    #[error("{call} `{object}`: {result}")]
    Call {
        /// The function's name.
        call: &'static str,
        /// The name of the object for which it was called.
        object: String,
        /// The result that it returned.
        result: CallResult,
    },
    /// The device has too little memory.
    #[error("memory for `{object}` ({}): {source}", mebibytes(*bytes))]
    Memory {
        /// The name of the buffer or image.
        object: String,
        /// The size of the buffer or image, bytes.
        bytes: u64,
        /// The allocator's error.
        source: Box<dyn error::Error + Send + Sync>,
    },
    /// The system has too little memory.
    #[error("memory for the {object} ({}): the system has too little", mebibytes(*bytes))]
    HostMemory {
        /// What the memory is for.
        object: &'static str,
        /// The memory's size, bytes.
        bytes: u64,
    },
    /// A buffer or image is larger than the device allows.
    #[error("`{object}` takes {}, more than this device's limit of {}", mebibytes(*bytes), mebibytes(*limit))]
    TooLarge {
        /// The name of the buffer or image.
        object: String,
        /// The size of the buffer or image, bytes.
        bytes: u64,
        /// The greatest size that the device allows, bytes.
        limit: u64,
    },
    /// Another thread has panicked while it held a lock, so the device's objects may be incomplete.
    #[error("another thread has panicked while it held the lock of the {0}")]
    Panicked(String),
    /// A scene and its acceleration structure do not match. The text describes the
    /// [`Mismatch`](crate::world::Mismatch).
    #[error("{0}")]
    Mismatch(String),
    /// An option is out of its range. The text is that of [`BadOptions`](crate::frame::BadOptions).
    #[error("{0}")]
    BadOptions(String),
    /// A number is beyond a limit of the device.
    #[error("{what}: {value} is beyond this device's limit of {limit}")]
    Limit {
        /// The name of the number.
        what: &'static str,
        /// The number.
        value: u64,
        /// The greatest number that the device allows.
        limit: u64,
    },
}

/// The result of a Vulkan call that has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CallResult(pub(super) vk::Result);

impl CallResult {
    /// Returns Vulkan's number for the result.
    pub fn code(&self) -> i32 {
        self.0.as_raw()
    }
}

impl fmt::Display for CallResult {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl GpuError {
    /// Whether the device or the window's surface is lost, so that all objects on it have to be made again.
    pub fn is_device_lost(&self) -> bool {
        let result = match self {
            Self::Call { result: CallResult(result), .. } => *result,
            _ => return false,
        };
        matches!(result, vk::Result::ERROR_DEVICE_LOST | vk::Result::ERROR_SURFACE_LOST_KHR)
    }

    /// Whether the machine has no Vulkan loader or no driver, so that only the CPU is left. Every other error of
    /// [`Device::open`](super::Device::open) tells of something that its caller can mend.
    pub fn is_without_driver(&self) -> bool {
        matches!(self, Self::NoLoader(_) | Self::NoDriver)
    }

    /// Whether the device or the system has too little memory.
    pub fn is_out_of_memory(&self) -> bool {
        let out_of_memory = [vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_OUT_OF_HOST_MEMORY];
        match self {
            Self::Memory { .. } | Self::HostMemory { .. } => true,
            Self::Call { result: CallResult(result), .. } => out_of_memory.contains(result),
            _ => false,
        }
    }

    /// Whether there is too little memory, or a buffer or image is larger than the device allows.
    pub(crate) fn is_lack_of_room(&self) -> bool {
        self.is_out_of_memory() || matches!(self, Self::TooLarge { .. })
    }

    /// Returns a function that turns the result of `call` on `object` into an error.
    pub(crate) fn call(call: &'static str, object: &str) -> impl FnOnce(vk::Result) -> GpuError {
        let object = object.to_owned();
        move |result| GpuError::Call { call, object, result: CallResult(result) }
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / (1 << 20) as f64)
}
