//! From facts of the machine to the usual causes why no GPU draws, or why the CPU draws slowly, each with its remedy.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{
    facts::{Driver, Facts, Sign, SignKind, Vendor},
    findings::{Problem, Verdict},
    probe::Answer,
};

/// Something that is wrong with the machine, though kdray may render all the same.
#[derive(Serialize)]
pub struct Cause {
    /// What it is about, for example a driver's manifest.
    pub about: String,
    #[serde(flatten)]
    pub verdict: Verdict<()>,
}

/// Returns the causes, the most telling first. `n_threads`: number of threads that kdray computes with.
pub fn causes(facts: &Facts, n_threads: usize) -> Vec<Cause> {
    let mut causes: Vec<Cause> = facts.drivers.iter().filter_map(|driver| of_ended_driver(driver, facts)).collect();
    if causes.is_empty() {
        causes.extend(of_all_drivers(facts));
    }
    // Elsewhere, device files and manifests are in other places.
    if cfg!(target_os = "linux") && !facts.has_gpu() {
        causes.extend(facts.drivers.iter().filter_map(of_driver_without_library));
        causes.extend(of_missing_gpu(facts));
    }
    causes.extend(of_quota(facts, n_threads));
    causes
}

fn cause(about: impl Into<String>, what: impl Into<String>, advice: impl Into<String>) -> Cause {
    let problem = Problem { what: what.into(), advice: advice.into() };
    Cause { about: about.into(), verdict: Verdict(Err(problem)) }
}

impl Facts {
    /// Whether a driver has a device that is no software.
    pub fn has_gpu(&self) -> bool {
        let answers = self.drivers.iter().filter_map(|driver| driver.answer.as_ref()).chain(&self.together);
        answers.into_iter().any(|answer| matches!(answer, Answer::Devices(all) if all.iter().any(|it| !it.is_software)))
    }

    /// Returns how all drivers together end the process that loads them, if they do.
    pub fn end_of_all(&self) -> Option<String> {
        self.together.as_ref().and_then(end_of)
    }

    /// Whether a driver is for the GPUs of a vendor.
    fn has_driver_for(&self, vendor: Vendor) -> bool {
        let libraries = self.drivers.iter().filter_map(|driver| driver.library.as_deref());
        libraries.into_iter().any(|library| vendor.has_driver(library))
    }
}

/// Returns how a driver ends the process that loads it, if it does.
fn end_of(answer: &Answer) -> Option<String> {
    match answer {
        Answer::Crashed(how) => Some(format!("it ends the process ({how})")),
        Answer::Hung(seconds) => Some(format!("it has not answered within {seconds} s")),
        _ => None,
    }
}

/// A driver that crashes or hangs hides the others, since the loader asks all of them.
fn of_ended_driver(driver: &Driver, facts: &Facts) -> Option<Cause> {
    let what = end_of(driver.answer.as_ref()?)?;
    let is_good = |other: &&Driver| matches!(other.answer, Some(Answer::Devices(_)));
    let others: Vec<_> =
        facts.drivers.iter().filter(is_good).map(|other| other.manifest.display().to_string()).collect();
    let advice = match others.is_empty() {
        true => "reinstall this driver, or remove its manifest".to_owned(),
        false => format!("leave it out by VK_DRIVER_FILES={}", others.join(":")),
    };
    Some(cause(about(&driver.manifest), what + ", and can hide all other drivers", advice))
}

fn of_all_drivers(facts: &Facts) -> Option<Cause> {
    let what = facts.end_of_all()?.replacen("it ", "loading them together ", 1);
    let advice = "name the one to use, as in VK_DRIVER_FILES=MANIFEST";
    Some(cause("Vulkan drivers", what, advice))
}

fn of_driver_without_library(driver: &Driver) -> Option<Cause> {
    match (&driver.library, &driver.answer) {
        (None, _) => Some(cause(about(&driver.manifest), "it is no manifest of a driver", "reinstall the driver")),
        (Some(library), Some(Answer::NotLoaded(reason))) => Some(cause(
            about(&driver.manifest),
            format!("its library `{library}` cannot be loaded: {reason}"),
            "install the library that is named; in a container, it and what it needs must be in the image, or be \
             passed in by the toolkit of the GPU's vendor",
        )),
        _ => None,
    }
}

fn about(manifest: &Path) -> String {
    format!("driver {}", manifest.display())
}

/// Returns why there is no GPU, as far as the signs of GPUs tell.
fn of_missing_gpu(facts: &Facts) -> Vec<Cause> {
    let of_kind = |kind: SignKind| facts.gpus.iter().filter(move |sign| sign.kind == kind);
    if let Some(Sign { path, .. }) = of_kind(SignKind::ClosedDeviceFile).next() {
        let what = format!("`{}` may not be opened by this user", path.display());
        let advice = "add the user to the group of this file (often `render` or `video`; docker run --group-add), or \
                      pass it into the container (docker run --device)";
        return vec![cause("GPU", what, advice)];
    }
    if of_kind(SignKind::DeviceFile).next().is_some() {
        let lacks_driver = |sign: &&Sign| sign.vendor.is_some_and(|vendor| !facts.has_driver_for(vendor));
        let lacking = of_kind(SignKind::DeviceFile).find(lacks_driver);
        return lacking.map(|sign| of_missing_driver(sign, facts)).into_iter().collect();
    }
    match of_kind(SignKind::Pci).next() {
        Some(sign) => vec![of_missing_device_file(sign)],
        None => vec![cause(
            "GPU",
            "there is no sign of one: neither /dev/nvidia0 nor /dev/dri/renderD128, and none on the PCI bus",
            "give the machine or the container a GPU (docker run --gpus all, or --device /dev/dri), or render with \
             --cpu",
        )],
    }
}

/// The GPU is there, but no manifest of a driver for it.
fn of_missing_driver(sign: &Sign, facts: &Facts) -> Cause {
    let path = sign.path.display();
    if sign.vendor == Some(Vendor::Nvidia) {
        let stated = match &facts.nvidia_capabilities {
            Some(value) => format!("NVIDIA_DRIVER_CAPABILITIES is `{value}`"),
            None => "NVIDIA_DRIVER_CAPABILITIES is not set".to_owned(),
        };
        return cause(
            "GPU",
            format!("`{path}` is there, but no manifest of NVIDIA's Vulkan driver; {stated}"),
            "start the container with NVIDIA_DRIVER_CAPABILITIES=all, or a list with `graphics`; outside of \
             containers, install the part of NVIDIA's driver for graphics",
        );
    }
    let advice = "install Mesa's Vulkan drivers in the machine or the container's image (mesa-vulkan-drivers)";
    cause("GPU", format!("`{path}` is there, but no manifest of a Vulkan driver for it"), advice)
}

/// The GPU is on the bus, but no driver of the kernel has made a device file, or the container has none.
fn of_missing_device_file(sign: &Sign) -> Cause {
    let slot = sign.path.file_name().map(PathBuf::from).unwrap_or_default();
    let (files, pass) = match sign.vendor {
        Some(Vendor::Nvidia) => ("/dev/nvidia0", "docker run --gpus all"),
        _ => ("/dev/dri/renderD128", "docker run --device /dev/dri"),
    };
    cause(
        "GPU",
        format!("one is on the PCI bus ({}), but there is no file such as {files}", slot.display()),
        format!("in a container, pass it in ({pass}); elsewhere, load the kernel's driver for it"),
    )
}

/// More threads than the quota allows are stopped again and again, and fewer cores than there are draw.
fn of_quota(facts: &Facts, n_threads: usize) -> Option<Cause> {
    let (cores, quota) = (facts.cpus.cores?, facts.cpus.quota?);
    if quota >= cores as f64 {
        return None;
    }
    let what = format!("a quota allows the time of {quota} of the {cores} cores, and kdray uses {n_threads} threads");
    let n_allowed = (quota.ceil() as usize).max(1);
    let raise = "raise the container's limit (docker run --cpus, limits.cpu in Kubernetes)";
    let advice = match n_threads > n_allowed {
        true => format!("{raise}, or render with --threads {n_allowed}"),
        false => format!("{raise} if --cpu and building take too long"),
    };
    Some(cause("CPU", what, advice))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::doctor::{probe::Probed, quota::Cpus};

    fn driver(library: &str, answer: Answer) -> Driver {
        let manifest = PathBuf::from(format!("/icd/{library}.json"));
        Driver { manifest, library: Some(library.to_owned()), answer: Some(answer) }
    }

    fn devices(is_software: bool) -> Answer {
        Answer::Devices(vec![Probed { name: "d".to_owned(), is_software }])
    }

    fn sign(path: &str, vendor: Vendor, kind: SignKind) -> Sign {
        Sign { path: path.into(), vendor: Some(vendor), kind }
    }

    /// Asserts that there is one cause, and that its line contains all words.
    fn assert_cause(facts: &Facts, words: &[&str]) {
        let found = causes(facts, 2);
        let lines: Vec<_> = found.iter().map(|cause| cause.verdict.line(&cause.about, |()| String::new())).collect();
        assert_eq!(lines.len(), 1, "{lines:?}");
        words.iter().for_each(|word| assert!(lines[0].contains(word), "{word}: {}", lines[0]));
    }

    #[test]
    fn causes_of_a_missing_gpu_are_told_apart() {
        let software = || vec![driver("lvp", devices(true))];
        let with = |gpus: Vec<Sign>| Facts { gpus, drivers: software(), ..Facts::default() };
        assert_cause(&with(Vec::new()), &["GPU: wrong: there is no sign of one", "--cpu"]);
        let nvidia = sign("/dev/nvidia0", Vendor::Nvidia, SignKind::DeviceFile);
        let capabilities = Some("compute,utility".to_owned());
        let toolkit = Facts { nvidia_capabilities: capabilities, ..with(vec![nvidia.clone()]) };
        assert_cause(&toolkit, &["/dev/nvidia0", "CAPABILITIES is `compute,utility`", "a list with `graphics`"]);
        assert_cause(&with(vec![nvidia.clone()]), &["CAPABILITIES is not set", "a list with `graphics`"]);
        let amd = sign("/dev/dri/renderD128", Vendor::Amd, SignKind::DeviceFile);
        assert_cause(&with(vec![amd.clone()]), &["renderD128` is there", "mesa-vulkan-drivers"]);
        let closed = Sign { kind: SignKind::ClosedDeviceFile, ..amd };
        assert_cause(&with(vec![closed]), &["may not be opened", "--group-add"]);
        let on_bus = sign("/sys/bus/pci/devices/0000:01:00.0", Vendor::Nvidia, SignKind::Pci);
        assert_cause(&with(vec![on_bus.clone()]), &["on the PCI bus (0000:01:00.0)", "--gpus all"]);
        let broken = driver("libGLX_nvidia.so.0", Answer::NotLoaded("cannot open x".to_owned()));
        let facts = Facts { drivers: vec![broken], ..with(vec![nvidia.clone()]) };
        assert_cause(&facts, &["driver /icd/libGLX_nvidia.so.0.json", "cannot be loaded: cannot open x", "container"]);
        // With a GPU that works, nothing is wrong.
        let works = Facts { drivers: vec![driver("libGLX_nvidia.so.0", devices(false))], ..with(vec![nvidia, on_bus]) };
        assert!(causes(&works, 2).is_empty());
    }

    #[test]
    fn a_driver_that_ends_the_process_is_named_and_left_out() {
        for (end, word) in [(Answer::Crashed("signal: 11".to_owned()), "signal: 11"), (Answer::Hung(20), "20 s")] {
            let drivers = vec![driver("bad", end.clone()), driver("lvp", devices(true)), driver("gpu", devices(false))];
            let facts = Facts { drivers, together: Some(end.clone()), ..Facts::default() };
            assert_cause(&facts, &["driver /icd/bad.json: wrong: it ", word, "=/icd/lvp.json:/icd/gpu.json"]);
            let alone_well =
                Facts { drivers: vec![driver("gpu", devices(false))], together: Some(end), ..Facts::default() };
            assert_cause(
                &alone_well,
                &["Vulkan drivers: wrong: loading them together", word, "VK_DRIVER_FILES=MANIFEST"],
            );
        }
    }

    #[test]
    fn a_quota_below_the_cores_is_a_cause() {
        let with = |cores, quota| {
            let cpus = Cpus { cores: Some(cores), quota };
            Facts { cpus, drivers: vec![driver("gpu", devices(false))], ..Facts::default() }
        };
        assert_cause(&with(64, Some(1.0)), &["CPU: wrong: ", "time of 1 of the 64 cores", "--threads 1"]);
        assert_cause(&with(64, Some(2.5)), &["time of 2.5 of the 64", "--cpus", "if --cpu"]);
        assert!(causes(&with(2, Some(2.0)), 2).is_empty() && causes(&with(2, None), 2).is_empty());
    }
}
