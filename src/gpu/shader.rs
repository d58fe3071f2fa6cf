//! Shaders that build.rs has compiled, and their replacements while the program runs (hot reload).

use std::io::Cursor;

use ash::vk;

#[cfg(feature = "view")]
use super::lock::{Rank, lock_anyway};
use super::{GpuError, raw_device::RawDevice};

/// A shader that is compiled into the program.
#[derive(Clone, Copy)]
pub struct Shader {
    /// Name of the shader's file, such as one in glsl/passes.
    pub file: &'static str,
    /// The SPIR-V module's bytes.
    pub spirv: &'static [u8],
}

/// SPIR-V modules that replace those compiled into the program. The key is [`Shader::file`].
#[cfg(feature = "view")]
pub type Replacements = std::collections::HashMap<String, Vec<u8>>;

#[cfg(feature = "view")]
impl super::Context {
    /// Sets the replacements from which later pipelines are made, and returns the earlier replacements.
    pub fn replace_shaders(&self, replacements: Replacements) -> Replacements {
        let mut current = lock_anyway(Rank::Replacements, &self.device.replacements);
        std::mem::replace(&mut current, replacements)
    }
}

impl RawDevice {
    /// Whether pipelines are made of another module than that which is compiled into the program.
    #[cfg(feature = "view")]
    pub fn has_replacement(&self, shader: Shader) -> bool {
        lock_anyway(Rank::Replacements, &self.replacements).contains_key(shader.file)
    }

    #[cfg(not(feature = "view"))]
    pub fn has_replacement(&self, _: Shader) -> bool {
        false
    }
}

/// A shader module, which is needed only while a pipeline is made from it.
pub(super) struct ShaderModule<'a> {
    pub(super) raw: vk::ShaderModule,
    /// Whether it is not the module that is compiled into the program.
    pub(super) is_replacement: bool,
    device: &'a RawDevice,
}

impl<'a> ShaderModule<'a> {
    pub(super) fn new(device: &'a RawDevice, shader: Shader) -> Result<Self, GpuError> {
        #[cfg(feature = "view")]
        {
            let replacements = lock_anyway(Rank::Replacements, &device.replacements);
            if let Some(spirv) = replacements.get(shader.file) {
                return Self::of(device, shader.file, (spirv, true));
            }
        }
        Self::of(device, shader.file, (shader.spirv, false))
    }

    fn of(device: &'a RawDevice, file: &str, (spirv, is_replacement): (&[u8], bool)) -> Result<Self, GpuError> {
        let code = ash::util::read_spv(&mut Cursor::new(spirv)).expect("build.rs writes whole SPIR-V words");
        let info = vk::ShaderModuleCreateInfo::default().code(&code);
        // SAFETY: the code lives until the call returns.
        let raw = unsafe { device.raw.create_shader_module(&info, None) }
            .map_err(GpuError::call("vkCreateShaderModule", file))?;
        Ok(Self { raw, is_replacement, device })
    }
}

impl Drop for ShaderModule<'_> {
    fn drop(&mut self) {
        // SAFETY: a pipeline does not need its modules once it is made.
        unsafe { self.device.raw.destroy_shader_module(self.raw, None) };
    }
}
