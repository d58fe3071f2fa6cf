//! Overrides with which tests give a device less than it has, or make it run kernels in another way.

/// Properties that a context reports and acts on in place of the device's own. All default to the device's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceOverrides {
    /// Greatest size of a bound storage buffer, bytes. It has no effect if the device allows less. Small scenes then
    /// take the paths that otherwise only large scenes take.
    pub storage_range: Option<u64>,
    /// Greatest number of texels in a view of a buffer. It has no effect if the device allows less.
    pub n_texels: Option<u32>,
    /// Result of [`Context::n_lanes`](super::Context::n_lanes). With it, a software driver is taken for one that does
    /// not predicate branches, so it runs the code that GPUs run.
    pub n_lanes: Option<u32>,
    /// Whether kernels lack 64-bit atomics.
    pub no_int64_atomics: bool,
    /// Whether the device checks the bounds of buffers, so that a kernel that reads or writes beyond them harms nothing
    /// else. Otherwise kernels are made without such checks (`robustness.rs`).
    pub bounds_checks: bool,
    /// Number of iterations of a kernel's loops after which the driver ends the kernel.
    pub loop_limit: Option<u32>,
    /// Whether each buffer has memory of its own, which is overwritten before it is released. In a block that buffers
    /// share, a kernel that reads a released buffer finds what was there, and nobody notices.
    pub marks_released: bool,
    /// Whether all inputs of streams are copied to the device's memory, even if the device has no queue for copies.
    pub copies_inputs: bool,
    /// Number of rays whose state can be stored at a time, if kernels have to stop before the loop limit.
    pub n_suspension_slots: Option<usize>,
}
