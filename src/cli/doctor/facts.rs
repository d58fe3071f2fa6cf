//! Facts of the machine that explain why a GPU cannot be used: signs of GPUs, manifests of Vulkan drivers, and the
//! quota of CPU time. Tests feed made-up machines: all files are looked up below a root folder.

use std::{
    collections::BTreeSet,
    env,
    ffi::OsString,
    fs, io,
    path::{Path, PathBuf},
};

use serde::Serialize;
use serde_json::Value;

use super::{
    probe::{self, Answer},
    quota::Cpus,
};

/// What is known of the machine beside what Vulkan says.
#[derive(Debug, Default, Serialize)]
pub struct Facts {
    /// What shows that there are GPUs.
    pub gpus: Vec<Sign>,
    /// The drivers whose manifests the Vulkan loader reads.
    pub drivers: Vec<Driver>,
    /// What all drivers together have answered. `None` if they were not asked.
    pub together: Option<Answer>,
    pub cpus: Cpus,
    /// The value of `NVIDIA_DRIVER_CAPABILITIES`, by which NVIDIA's container toolkit chooses what it passes in.
    pub nvidia_capabilities: Option<String>,
}

/// A sign that there is a GPU.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Sign {
    pub path: PathBuf,
    pub vendor: Option<Vendor>,
    pub kind: SignKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SignKind {
    /// A file in `/dev` through which the driver reaches the GPU.
    DeviceFile,
    /// Such a file that the user may not open.
    ClosedDeviceFile,
    /// A device on the PCI bus. A container sees those of its host.
    Pci,
}

/// Vendors of GPUs whose drivers are told apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Vendor {
    Nvidia,
    Amd,
    Intel,
}

/// A manifest of a Vulkan driver (ICD).
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Driver {
    pub manifest: PathBuf,
    /// The library that the manifest names. `None` if the manifest cannot be read.
    pub library: Option<String>,
    /// What the driver has answered alone. `None` if it was not asked.
    pub answer: Option<Answer>,
}

impl Vendor {
    fn of_pci_id(text: &str) -> Option<Self> {
        match text.trim() {
            "0x10de" => Some(Self::Nvidia),
            "0x1002" => Some(Self::Amd),
            "0x8086" => Some(Self::Intel),
            _ => None,
        }
    }

    /// Whether a driver is for GPUs of this vendor, by the name of its library.
    pub fn has_driver(self, library: &str) -> bool {
        let words: &[&str] = match self {
            Self::Nvidia => &["nvidia", "nouveau"],
            Self::Amd => &["radeon", "amdvlk", "amdgpu"],
            Self::Intel => &["intel"],
        };
        words.iter().any(|word| library.to_lowercase().contains(word))
    }
}

impl Facts {
    /// Returns what the files below `root` and the environment say. No driver is asked.
    pub fn gather(root: &Path, variable: impl Fn(&str) -> Option<OsString>) -> Self {
        let driver = |manifest: PathBuf| Driver { library: library_of(&manifest), manifest, answer: None };
        Self {
            gpus: [device_files(root), pci_devices(root)].concat(),
            drivers: manifests(root, &variable).into_iter().map(driver).collect(),
            together: None,
            cpus: Cpus::gather(root),
            nvidia_capabilities: variable("NVIDIA_DRIVER_CAPABILITIES").map(|it| it.to_string_lossy().into_owned()),
        }
    }

    /// Returns the facts of this machine. All drivers are asked at the same time, each in a process of its own.
    pub fn of_machine() -> Self {
        let mut facts = Self::gather(Path::new("/"), |name| env::var_os(name));
        std::thread::scope(|scope| {
            let ask = |driver: &Driver| {
                let manifest = driver.manifest.clone().into_os_string();
                scope.spawn(move || probe::probe(Some(&manifest)).ok())
            };
            let together = scope.spawn(|| probe::probe(None).ok());
            let answers: Vec<_> = facts.drivers.iter().map(ask).collect();
            for (driver, answer) in facts.drivers.iter_mut().zip(answers) {
                driver.answer = answer.join().ok().flatten();
            }
            facts.together = together.join().ok().flatten();
        });
        facts
    }
}

/// Returns the device files of GPUs.
fn device_files(root: &Path) -> Vec<Sign> {
    let mut signs = Vec::new();
    for name in entries(&root.join("dev")) {
        let is_gpu = name.strip_prefix("nvidia").is_some_and(|rest| rest.parse::<u32>().is_ok());
        if is_gpu {
            signs.push(sign_of_file(root.join("dev").join(&name), Some(Vendor::Nvidia)));
        }
    }
    for name in entries(&root.join("dev/dri")).into_iter().filter(|name| name.starts_with("renderD")) {
        let vendor = fs::read_to_string(root.join("sys/class/drm").join(&name).join("device/vendor"));
        let vendor = vendor.ok().and_then(|text| Vendor::of_pci_id(&text));
        signs.push(sign_of_file(root.join("dev/dri").join(&name), vendor));
    }
    signs
}

fn sign_of_file(path: PathBuf, vendor: Option<Vendor>) -> Sign {
    let opened = fs::File::options().read(true).write(true).open(&path);
    let is_closed = opened.is_err_and(|error| error.kind() == io::ErrorKind::PermissionDenied);
    let kind = if is_closed { SignKind::ClosedDeviceFile } else { SignKind::DeviceFile };
    Sign { path, vendor, kind }
}

/// Returns the display and 3D controllers on the PCI bus of vendors whose GPUs have Vulkan drivers. Those of others are
/// virtual ones, or show the console of a server.
fn pci_devices(root: &Path) -> Vec<Sign> {
    let folder = root.join("sys/bus/pci/devices");
    let sign = |name: String| {
        let path = folder.join(name);
        let read = |file: &str| fs::read_to_string(path.join(file)).unwrap_or_default();
        let vendor = Vendor::of_pci_id(&read("vendor"))?;
        read("class").starts_with("0x03").then_some(Sign {
            vendor: Some(vendor),
            kind: SignKind::Pci,
            path: path.clone(),
        })
    };
    entries(&folder).into_iter().filter_map(sign).collect()
}

/// Returns the sorted names in a folder, none if it cannot be read.
fn entries(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names: BTreeSet<_> = entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.into_iter().collect()
}

/// Returns the manifests that the Vulkan loader reads on Linux, in its order of folders.
fn manifests(root: &Path, variable: &impl Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let set = |name: &str| variable(name).filter(|value| !value.is_empty());
    let list = |value: OsString| env::split_paths(&value).flat_map(|path| manifests_at(&path)).collect::<Vec<_>>();
    if let Some(only) = set("VK_DRIVER_FILES").or_else(|| set("VK_ICD_FILENAMES")) {
        return list(only);
    }
    let below = |path: &str| root.join(path.trim_start_matches('/'));
    let home = |own: &str, folder: &str| {
        let own = set(own).map(PathBuf::from);
        own.or_else(|| Some(PathBuf::from(set("HOME")?).join(folder))).into_iter().collect::<Vec<_>>()
    };
    let system = |name: &str, default: &[&str]| match set(name) {
        Some(value) => env::split_paths(&value).collect(),
        None => default.iter().map(|path| below(path)).collect::<Vec<_>>(),
    };
    let folders = [
        home("XDG_CONFIG_HOME", ".config"),
        system("XDG_CONFIG_DIRS", &["/etc/xdg"]),
        vec![below("/etc")],
        home("XDG_DATA_HOME", ".local/share"),
        system("XDG_DATA_DIRS", &["/usr/local/share", "/usr/share"]),
    ];
    let found = folders.concat().into_iter().flat_map(|folder| manifests_at(&folder.join("vulkan/icd.d")));
    let mut known = BTreeSet::new();
    let added = set("VK_ADD_DRIVER_FILES").map(list).unwrap_or_default();
    added.into_iter().chain(found).filter(|path| known.insert(path.clone())).collect()
}

/// Returns a manifest itself, or the manifests in a folder.
fn manifests_at(path: &Path) -> Vec<PathBuf> {
    match path.is_dir() {
        true => entries(path).iter().filter(|name| name.ends_with(".json")).map(|name| path.join(name)).collect(),
        false if path.exists() => vec![path.to_owned()],
        false => Vec::new(),
    }
}

/// Returns the library that a manifest names.
fn library_of(manifest: &Path) -> Option<String> {
    let json: Value = serde_json::from_str(&fs::read_to_string(manifest).ok()?).ok()?;
    Some(json["ICD"]["library_path"].as_str()?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, name: &str, text: &str) {
        let path = root.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    #[test]
    fn signs_of_gpus_are_found() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        for name in ["nvidia0", "nvidiactl", "nvidia-uvm", "null", "dri/card0", "dri/renderD128"] {
            write(root, &format!("dev/{name}"), "");
        }
        write(root, "sys/class/drm/renderD128/device/vendor", "0x1002\n");
        // A GPU, the console of a virtual machine, and a network card.
        for (slot, class, vendor) in
            [("0:1", "0x030200\n", "0x10de\n"), ("0:2", "0x030000\n", "0x1234\n"), ("0:3", "0x020000\n", "0x8086\n")]
        {
            write(root, &format!("sys/bus/pci/devices/{slot}/class"), class);
            write(root, &format!("sys/bus/pci/devices/{slot}/vendor"), vendor);
        }
        let found = Facts::gather(root, |_| None).gpus;
        let sign = |path: &str, vendor, kind| Sign { path: root.join(path), vendor: Some(vendor), kind };
        let expected = [
            sign("dev/nvidia0", Vendor::Nvidia, SignKind::DeviceFile),
            sign("dev/dri/renderD128", Vendor::Amd, SignKind::DeviceFile),
            sign("sys/bus/pci/devices/0:1", Vendor::Nvidia, SignKind::Pci),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn manifests_are_those_that_the_loader_reads() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        let manifest = r#"{"ICD": {"library_path": "libx.so"}}"#;
        for (name, text) in
            [("usr/share/vulkan/icd.d/b.json", manifest), ("etc/vulkan/icd.d/a.json", "{"), ("own/c.json", manifest)]
        {
            write(root, name, text);
        }
        write(root, "usr/share/vulkan/icd.d/read.me", "");
        let found = |variable: &dyn Fn(&str) -> Option<OsString>| -> Vec<(String, Option<String>)> {
            let drivers = Facts::gather(root, variable).drivers.into_iter();
            let name = |path: &Path| path.strip_prefix(root).unwrap().display().to_string();
            drivers.map(|driver| (name(&driver.manifest), driver.library)).collect()
        };
        let library = Some("libx.so".to_owned());
        let of_system = [
            ("etc/vulkan/icd.d/a.json".to_owned(), None),
            ("usr/share/vulkan/icd.d/b.json".to_owned(), library.clone()),
        ];
        assert_eq!(found(&|_| None), of_system);
        let own = root.join("own");
        for (name, value) in [("VK_DRIVER_FILES", own.clone()), ("VK_ICD_FILENAMES", own.join("c.json"))] {
            let set = |variable: &str| (variable == name).then(|| value.clone().into_os_string());
            assert_eq!(found(&set), [("own/c.json".to_owned(), library.clone())], "{name}");
        }
    }
}
