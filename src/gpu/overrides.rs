//! What tests make of a device: one that has less than it has, or runs kernels in another way.

/// Properties that a context reports and acts on in place of the device's own. All default to the device's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceOverrides {
    /// Bytes of a storage buffer that can be bound, if the device binds more. Small scenes then meet what large ones
    /// meet elsewhere.
    pub storage_range: Option<u64>,
    /// Texels of a buffer, if the device has more.
    pub n_texels: Option<u32>,
    /// Lanes of a device that takes branches lane by lane. A software driver then runs what GPUs run.
    pub n_lanes: Option<u32>,
    /// Whether kernels lack atomics of 64 bits.
    pub no_wide_atomics: bool,
    /// Turns of a kernel's loops after which the driver ends it.
    pub loop_limit: Option<u32>,
    /// Rays whose state is stored at a time, where kernels have to stop before that limit.
    pub n_stall_slots: Option<usize>,
}
