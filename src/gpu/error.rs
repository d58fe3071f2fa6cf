//! What can go wrong with a driver, each in one line that names the call and the object.

use ash::vk;

/// Anything that stops a device from doing its work.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    #[error("no Vulkan loader ({0}); ./setup installs it")]
    NoLoader(String),
    #[error("no Vulkan driver found; ./setup installs Mesa's lavapipe, which needs no GPU")]
    NoDriver,
    #[error("no Vulkan device `{wanted}`; there are: {available}")]
    NoSuchDevice { wanted: String, available: String },
    #[error("device `{device}` lacks {missing}")]
    Lacks { device: String, missing: String },
    #[error("no validation layer VK_LAYER_KHRONOS_validation; ./setup installs it")]
    NoValidationLayer,
    #[error("cannot show pictures in this window: {0}")]
    NoSurface(String),
    #[error("{object}: {message}")]
    Other { object: &'static str, message: String },
    #[error("{call} `{object}`: {result}")]
    Call { call: &'static str, object: String, result: vk::Result },
    #[error("memory for `{object}` ({}): {source}", mebibytes(*bytes))]
    Memory { object: String, bytes: u64, source: gpu_allocator::AllocationError },
    #[error("memory for the {object} ({}): the system has too little", mebibytes(*bytes))]
    HostMemory { object: &'static str, bytes: u64 },
    #[error("`{object}` takes {}, more than this device's limit of {}", mebibytes(*bytes), mebibytes(*limit))]
    TooLarge { object: String, bytes: u64, limit: u64 },
    #[error("{0}")]
    Mismatch(String),
    #[error("{what}: {value} is beyond this device's limit of {limit}")]
    Limit { what: &'static str, value: u64, limit: u64 },
}

impl GpuError {
    /// Whether the device or the window's surface is gone, so that all that is on it has to be made anew.
    pub fn is_device_lost(&self) -> bool {
        let result = match self {
            Self::Call { result, .. } => *result,
            _ => return false,
        };
        matches!(result, vk::Result::ERROR_DEVICE_LOST | vk::Result::ERROR_SURFACE_LOST_KHR)
    }

    /// Whether the device or the system has too little memory.
    pub fn is_out_of_memory(&self) -> bool {
        let out_of_memory = [vk::Result::ERROR_OUT_OF_DEVICE_MEMORY, vk::Result::ERROR_OUT_OF_HOST_MEMORY];
        match self {
            Self::Memory { .. } | Self::HostMemory { .. } => true,
            Self::Call { result, .. } => out_of_memory.contains(result),
            _ => false,
        }
    }

    /// Turns the result of `call` on `object` into an error.
    pub(super) fn call(call: &'static str, object: &str) -> impl FnOnce(vk::Result) -> GpuError {
        let object = object.to_owned();
        move |result| GpuError::Call { call, object, result }
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / (1 << 20) as f64)
}
