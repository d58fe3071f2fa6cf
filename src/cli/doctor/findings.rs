//! What `kdray doctor` has found, as text and as JSON.

use kdray::{
    gpu::{DeviceInfo, GpuError},
    util::memory::in_words,
};
use serde::{Serialize, Serializer};

use super::{causes::Cause, check::Passed, examine::Examined, facts::Facts, host::Host};

/// All that was found, in the order of the report.
#[derive(Serialize)]
pub struct Findings {
    #[serde(flatten)]
    pub host: Host,
    /// Whether there are a Vulkan loader, a driver and a device.
    pub vulkan: Verdict<()>,
    /// What explains missing GPUs and slow CPUs. It does not count in the verdict of all.
    pub causes: Vec<Cause>,
    /// The facts from which the causes follow.
    pub facts: Facts,
    /// The Vulkan devices in the loader's order, then the CPU.
    pub processors: Vec<ProcessorFindings>,
    /// None if the user named no scene.
    pub scene: Option<Verdict<SceneFindings>>,
}

/// What was found of a device or of the CPU.
#[derive(Serialize)]
pub struct ProcessorFindings {
    /// None for the CPU.
    device: Option<DeviceInfo>,
    /// The check with the sample picture.
    sample: Verdict<Passed>,
    /// None if no scene was examined on the processor.
    scene: Option<Verdict<Examined>>,
}

/// What was found of the scene itself.
#[derive(Serialize)]
pub struct SceneFindings {
    pub name: String,
    /// The hash that pictures of the scene state.
    pub hash: String,
    /// The hash of the pack that the scene is in, which `kdray pack` prints. None if it is in no pack.
    pub pack_hash: Option<String>,
    pub triangles: usize,
    /// Size of the acceleration structure.
    pub structure_bytes: u64,
    /// Size of the picture that the scene states, pixels.
    pub width: u32,
    pub height: u32,
    pub load_ms: f64,
    pub build_ms: f64,
}

/// The result of a check.
pub struct Verdict<T>(pub Result<T, Problem>);

/// Something that is wrong, and what the user can do about it. Both are parts of a line of the report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    pub what: String,
    pub advice: String,
}

impl Problem {
    fn new(what: impl Into<String>, advice: &str) -> Self {
        Self { what: what.into(), advice: advice.to_owned() }
    }

    /// Returns the problem that a scene cannot be loaded, or its structure cannot be built.
    pub fn of_scene(what: &str) -> Self {
        Self::new(
            what,
            "mend or copy the file that is named, or put the scene and all its files into one with `kdray pack`",
        )
    }

    /// Returns the problem that drivers end each process that loads them, for example doctor's own.
    pub fn of_ended_drivers(how: &str) -> Self {
        Self::new(format!("the drivers were not loaded: {how}"), "leave out the driver that is named below")
    }

    /// Returns the problem that Vulkan cannot be used at all.
    pub fn of_vulkan(error: &GpuError) -> Self {
        let advice = "install the Vulkan loader and the driver of the GPU, and see that VK_DRIVER_FILES, if it is set, \
                      names existing files; until then, render with --cpu";
        Self::new(error.to_string(), advice)
    }

    /// Returns the problem that a device lacks what kdray needs.
    pub fn of_lacking(device: &DeviceInfo) -> Self {
        let what = format!("it lacks {}", device.missing.join(", "));
        Self::new(what, "update its driver, or render on another device or with --cpu")
    }

    /// Returns the problem that a call has failed on a device.
    pub fn of_device(error: &GpuError) -> Self {
        match error.is_out_of_memory() {
            true => Self::of_memory(&error.to_string()),
            false => Self::new(error.to_string(), "update its driver, or render on another device or with --cpu"),
        }
    }

    /// Returns the problem that there is too little memory.
    pub fn of_memory(what: &str) -> Self {
        Self::new(what, "render a smaller picture (--size) or parts of it (--tile), or end other programs")
    }

    /// Returns the problem that the scene and its picture do not fit into the memory of a device.
    pub fn of_device_memory(needed: u64, available: u64) -> Self {
        let what = format!("the scene and a picture need {}, and it has {}", in_words(needed), in_words(available));
        Self::of_memory(&what)
    }

    /// Returns the problem that a device draws a wrong picture.
    pub fn of_wrong_picture(what: &str) -> Self {
        let advice = "do not use this device: update its driver and check it again";
        Self::new(format!("it draws a wrong picture: {what}"), advice)
    }

    /// Returns the problem that the CPU draws a wrong picture.
    pub fn of_cpu(what: &str) -> Self {
        Self::new(format!("it draws a wrong picture: {what}"), "do not use this build of kdray, and report the fault")
    }
}

impl<T: Serialize> Serialize for Verdict<T> {
    /// Writes `{"ok": true, "found": ..}` or `{"ok": false, "problem": .., "advice": ..}`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            Ok(found) => serde_json::json!({ "ok": true, "found": found }),
            Err(Problem { what, advice }) => serde_json::json!({ "ok": false, "problem": what, "advice": advice }),
        }
        .serialize(serializer)
    }
}

impl<T> Verdict<T> {
    /// Returns a line: the label, and either `ok` with what `found` says of the result, or the problem with the advice.
    pub fn line(&self, label: &str, found: impl FnOnce(&T) -> String) -> String {
        match &self.0 {
            Ok(result) => format!("{label}: ok{}\n", found(result)),
            Err(Problem { what, advice }) => format!("{label}: wrong: {what}; {advice}\n"),
        }
    }
}

impl ProcessorFindings {
    pub fn new(device: Option<DeviceInfo>, checked: Result<Passed, Problem>) -> Self {
        Self { device, sample: Verdict(checked), scene: None }
    }

    /// Notes what was found of the scene.
    pub fn examine(&mut self, examined: Result<Examined, Problem>) {
        self.scene = Some(Verdict(examined));
    }

    /// Whether all checks so far were passed.
    pub fn is_ok(&self) -> bool {
        self.sample.0.is_ok() && self.scene.as_ref().is_none_or(|scene| scene.0.is_ok())
    }

    fn text(&self) -> String {
        let mut text = match &self.device {
            None => "\nCPU\n".to_owned(),
            Some(DeviceInfo { index, name, kind, driver, api_version, memory_bytes, .. }) => {
                let memory = in_words(*memory_bytes);
                format!("\ndevice {index}: {name}\n  {kind}, Vulkan {api_version}, driver {driver}, memory {memory}\n")
            }
        };
        let is_cpu = self.device.is_none();
        text += &self.sample.line("  sample picture", |&Passed { ms, differing_pixels, pixels }| match is_cpu {
            true => format!(", {ms:.0} ms"),
            false => format!(", {ms:.0} ms; {differing_pixels} of {pixels} pixels differ from the CPU's"),
        });
        if let Some(scene) = &self.scene {
            let memory = |bytes: Option<u64>| bytes.map_or(String::new(), |it| format!("; needs {}", in_words(it)));
            text += &scene.line("  scene", |found| format!(", {:.0} ms{}", found.ms, memory(found.needed_bytes)));
        }
        text
    }
}

impl SceneFindings {
    fn text(&self) -> String {
        let Self { name, hash, pack_hash, triangles, structure_bytes, width, height, load_ms, build_ms } = self;
        let structure = in_words(*structure_bytes);
        let of_pack = pack_hash.as_ref().map_or(String::new(), |hash| format!("\n  pack with hash {hash}"));
        format!(
            ", {name}, {triangles} triangles, hash {hash}{of_pack}\n  loaded in {load_ms:.0} ms, \
             structure of {structure} built in {build_ms:.0} ms, picture of {width}x{height} pixels"
        )
    }
}

impl Findings {
    /// Returns the findings as lines of text, the verdict of all last.
    pub fn text(&self) -> String {
        let mut text = self.host.text();
        text += &self.vulkan.line("Vulkan", |()| String::new());
        self.causes.iter().for_each(|cause| text += &cause.verdict.line(&cause.about, |()| String::new()));
        if let Some(scene) = &self.scene {
            text.push('\n');
            text += &scene.line("scene", SceneFindings::text);
        }
        self.processors.iter().for_each(|processor| text += &processor.text());
        text + &format!("\n{}\n", self.summary())
    }

    /// Whether a processor has passed all its checks.
    pub fn can_render(&self) -> bool {
        self.processors.iter().any(ProcessorFindings::is_ok)
    }

    /// Returns what to say if no processor has passed its checks.
    pub fn refusal(&self) -> String {
        let what = if self.scene.is_some() { "this scene" } else { "here" };
        format!("neither a Vulkan device nor the CPU can render {what}; the report says why")
    }

    /// Returns the verdict of all.
    fn summary(&self) -> String {
        let usable = |is_device: bool| {
            self.processors.iter().filter(move |it| it.device.is_some() == is_device && it.is_ok()).count()
        };
        let n_devices = self.processors.len() - 1;
        match (usable(true), usable(false)) {
            (0, 0) => format!("wrong: {}", self.refusal()),
            (0, _) => "ok, but only the CPU can render: use --cpu".to_owned(),
            (n, 0) => format!("ok: {n} of {n_devices} Vulkan devices can render, and the CPU cannot"),
            (n, _) => format!("ok: {n} of {n_devices} Vulkan devices can render, and so can the CPU"),
        }
    }
}
