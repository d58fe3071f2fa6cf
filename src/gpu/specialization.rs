//! Specialization constants of a pipeline: its own, and those of its binding layout.

use std::marker::PhantomData;

use ash::vk;

use super::BindingLayout;

/// A specialization constant. Its value is a `T`: a `u32` or a `bool`.
#[derive(Debug)]
pub struct Constant<T> {
    name: &'static str,
    /// The `constant_id` in GLSL.
    id: u32,
    value: PhantomData<T>,
}

impl<T> Constant<T> {
    /// Defines the constant with a name and a `constant_id`.
    pub const fn new(name: &'static str, id: u32) -> Self {
        Self { name, id, value: PhantomData }
    }
}

/// A value that a constant can have. Vulkan takes it as 32 bits.
pub trait ConstantValue {
    /// Returns the value's bits.
    fn word(self) -> u32;
}

impl ConstantValue for u32 {
    fn word(self) -> u32 {
        self
    }
}

impl ConstantValue for bool {
    fn word(self) -> u32 {
        self.into()
    }
}

/// Values of specialization constants.
#[derive(Clone, Debug, Default)]
pub struct Constants {
    /// Name, `constant_id` and bits of each constant.
    values: Vec<(&'static str, u32, u32)>,
}

impl Constants {
    /// Returns an empty list. Constants without a value here keep the default that the shader declares.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the value of a constant.
    ///
    /// # Panics
    /// The constant already has a value.
    #[must_use]
    pub fn set<T: ConstantValue>(mut self, constant: Constant<T>, value: T) -> Self {
        assert!(self.names().all(|name| name != constant.name), "{} is set twice", constant.name);
        self.values.push((constant.name, constant.id, value.word()));
        self
    }

    /// Returns the same values, except for that of one constant, which need not have a value yet.
    pub(super) fn with<T: ConstantValue>(&self, constant: Constant<T>, value: T) -> Self {
        let others = self.values.iter().filter(|(name, ..)| *name != constant.name);
        Self { values: others.copied().collect() }.set(constant, value)
    }

    /// Returns the bits of a constant's value, if it has one.
    pub(super) fn value<T>(&self, constant: Constant<T>) -> Option<u32> {
        self.values.iter().find(|(name, ..)| *name == constant.name).map(|(.., bits)| *bits)
    }

    /// Returns the names of the constants that have values.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.values.iter().map(|(name, ..)| *name)
    }
}

/// Constants as Vulkan takes them: 32 bits each.
pub(super) struct Specialization {
    entries: Vec<vk::SpecializationMapEntry>,
    values: Vec<u32>,
}

impl Specialization {
    /// Combines a pipeline's own constants with those of its binding layout.
    pub fn new(own: &Constants, bindings: &BindingLayout) -> Self {
        let (mut entries, mut values) = (Vec::new(), Vec::new());
        for (_, constant_id, value) in own.values.iter().chain(&bindings.constants.values) {
            let offset = 4 * values.len() as u32;
            entries.push(vk::SpecializationMapEntry { constant_id: *constant_id, offset, size: 4 });
            values.push(*value);
        }
        Self { entries, values }
    }

    /// Returns the `constant_id` and the bits of each constant.
    pub fn values(&self) -> Vec<(u32, u32)> {
        self.entries.iter().map(|entry| entry.constant_id).zip(self.values.iter().copied()).collect()
    }

    pub fn info(&self) -> vk::SpecializationInfo<'_> {
        vk::SpecializationInfo::default().map_entries(&self.entries).data(bytemuck::cast_slice(&self.values))
    }
}
