//! The Vulkan loader and the instance, with the validation layer if it is requested.

use std::{
    ffi::{CStr, c_void},
    sync::{Arc, Mutex},
};

use ash::{ext, vk};

use super::{
    GpuError,
    lock::{Rank, lock_anyway},
};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Messages of the validation layer, in order of arrival.
pub(super) type Messages = Mutex<Vec<String>>;

pub(super) struct Instance {
    pub entry: ash::Entry,
    pub raw: ash::Instance,
    pub has_debug_utils: bool,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    // The messages are boxed, so that the messenger's pointer to them stays valid when the instance moves.
    messages: Box<Messages>,
    /// Whether the caller of the library owns the instance and destroys it.
    is_external: bool,
}

impl Instance {
    /// Creates an instance. `validate` turns on the validation layer with synchronization validation and keeps its
    /// messages.
    pub fn new(validate: bool) -> Result<Arc<Self>, GpuError> {
        Self::with_extensions(validate, &[])
    }

    /// Creates an instance as [`Instance::new`] does. `window` lists the further extensions that a window needs.
    pub fn with_extensions(validate: bool, window: &[&CStr]) -> Result<Arc<Self>, GpuError> {
        // SAFETY: the call loads the system's Vulkan loader, whose initialization code is trusted as any driver's is.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| GpuError::NoLoader(e.to_string()))?;
        if validate && !has_layer(&entry)? {
            return Err(GpuError::NoValidationLayer);
        }
        let has_debug_utils = has_extension(&entry, ext::debug_utils::NAME, validate.then_some(VALIDATION_LAYER))?;
        for name in window {
            if !has_extension(&entry, name, None)? {
                return Err(GpuError::NoSurface(format!("no Vulkan driver has {}", name.to_string_lossy())));
            }
        }
        let messages = Box::<Messages>::default();
        let raw = create(&entry, validate, has_debug_utils, window)?;
        let mut instance = Self { entry, raw, has_debug_utils, messenger: None, messages, is_external: false };
        if validate && has_debug_utils {
            instance.listen()?;
        }
        Ok(Arc::new(instance))
    }

    /// Wraps an instance that the library's caller owns.
    pub fn external(entry: ash::Entry, raw: ash::Instance) -> Arc<Self> {
        let messages = Box::default();
        Arc::new(Self { entry, raw, has_debug_utils: false, messenger: None, messages, is_external: true })
    }

    /// Whether the validation layer reports to this instance.
    pub fn validates(&self) -> bool {
        self.messenger.is_some()
    }

    pub fn messages(&self) -> Vec<String> {
        lock_anyway(Rank::Messages, &self.messages).clone()
    }

    /// Creates the messenger, which keeps the validation layer's messages.
    fn listen(&mut self) -> Result<(), GpuError> {
        let debug_utils = ext::debug_utils::Instance::new(&self.entry, &self.raw);
        let user_data = (&raw const *self.messages).cast_mut().cast();
        let info = messenger_info().user_data(user_data);
        // SAFETY: the messages outlive the messenger, which `Drop` destroys first.
        let messenger = unsafe { debug_utils.create_debug_utils_messenger(&info, None) }
            .map_err(GpuError::call("vkCreateDebugUtilsMessengerEXT", "validation"))?;
        self.messenger = Some((debug_utils, messenger));
        Ok(())
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: every device made from this instance holds it, so none is left.
        unsafe {
            if let Some((debug_utils, messenger)) = self.messenger.take() {
                debug_utils.destroy_debug_utils_messenger(messenger, None);
            }
            if !self.is_external {
                self.raw.destroy_instance(None);
            }
        }
    }
}

fn create(entry: &ash::Entry, validate: bool, debug_utils: bool, window: &[&CStr]) -> Result<ash::Instance, GpuError> {
    let application = vk::ApplicationInfo::default()
        .application_name(c"kdray")
        .engine_name(c"kdray")
        .api_version(vk::API_VERSION_1_3);
    // SAFETY: the call only reads the list of extensions.
    let available = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
    let portability =
        available.iter().any(|e| e.extension_name_as_c_str() == Ok(ash::khr::portability_enumeration::NAME));
    let mut extensions: Vec<_> = window.iter().map(|name| name.as_ptr()).collect();
    if debug_utils {
        extensions.push(ext::debug_utils::NAME.as_ptr());
    }
    let mut flags = vk::InstanceCreateFlags::empty();
    if portability {
        // The loader lists MoltenVK only to programs that accept drivers that are not fully conformant.
        extensions.push(ash::khr::portability_enumeration::NAME.as_ptr());
        flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
    }
    let layers: Vec<_> = validate.then_some(VALIDATION_LAYER.as_ptr()).into_iter().collect();
    let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
    let mut info = vk::InstanceCreateInfo::default()
        .application_info(&application)
        .enabled_extension_names(&extensions)
        .enabled_layer_names(&layers)
        .flags(flags);
    if validate {
        info = info.push_next(&mut features);
    }
    // SAFETY: all that `info` points to lives until the call returns.
    unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => GpuError::NoDriver,
        result => GpuError::call("vkCreateInstance", "kdray")(result),
    })
}

fn has_layer(entry: &ash::Entry) -> Result<bool, GpuError> {
    // SAFETY: the call only reads the list of layers.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(GpuError::call("vkEnumerateInstanceLayerProperties", "loader"))?;
    Ok(layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)))
}

/// Whether the loader, a driver or the given layer has an instance extension.
fn has_extension(entry: &ash::Entry, name: &CStr, layer: Option<&CStr>) -> Result<bool, GpuError> {
    for source in [None, layer] {
        // SAFETY: the call only reads the list of extensions.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(source) }
            .map_err(GpuError::call("vkEnumerateInstanceExtensionProperties", "loader"))?;
        if extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name)) {
            return Ok(true);
        }
    }
    Ok(false)
}

fn messenger_info() -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
        .pfn_user_callback(Some(keep_message))
}

/// Appends the message to the [`Messages`] behind `user_data`.
unsafe extern "system" fn keep_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user_data: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes data that is valid for the call's duration, and `user_data` points to
    // `Instance::messages`.
    unsafe {
        let messages = &*user_data.cast::<Messages>();
        let text = (*data).message_as_c_str().map_or_else(|| "(no text)".into(), CStr::to_string_lossy);
        lock_anyway(Rank::Messages, messages).push(text.into_owned());
    }
    vk::FALSE
}
