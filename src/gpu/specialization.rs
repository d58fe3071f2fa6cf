//! Specialization constants of a pipeline: its own, and those that its bindings bring.

use ash::vk;

use super::Bindings;

/// Constants as Vulkan takes them: 32 bits each.
pub(super) struct Specialization {
    entries: Vec<vk::SpecializationMapEntry>,
    values: Vec<u32>,
}

impl Specialization {
    /// `own`: constants 0, 1, ...
    pub fn new(own: &[u32], bindings: &Bindings) -> Self {
        let all = (0..).zip(own.iter().copied()).chain(bindings.constants.iter().copied());
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        for (constant_id, value) in all {
            entries.push(vk::SpecializationMapEntry { constant_id, offset: 4 * values.len() as u32, size: 4 });
            values.push(value);
        }
        Self { entries, values }
    }

    pub fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default().map_entries(&self.entries).data(bytemuck::cast_slice(&self.values))
    }
}
