//! The argument `--device`, and the devices that it opens.

use std::{collections::BTreeSet, str::FromStr};

use clap::ValueEnum;
use kdray::gpu::{ContextOptions, Device, DeviceInfo, DeviceSelector, GpuError, chosen_device, devices};

use super::{error::CliError, progress::Progress};

/// Value of `--device` of commands that can use several devices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceList {
    /// All devices that have the name and the driver of the best one.
    All,
    /// The named devices, at least one. A device may be named several times.
    Named(Vec<DeviceSelector>),
}

impl FromStr for DeviceList {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        match word {
            "all" => Ok(Self::All),
            list => list.split(',').map(device).collect::<Result<_, _>>().map(Self::Named),
        }
    }
}

/// Value of `--require`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Requirement {
    /// Vulkan devices that are no software drivers
    Gpu,
}

impl Requirement {
    /// Refuses devices that are software drivers, before they are opened. Without a list, it is about the best device.
    pub fn check(self, list: Option<&DeviceList>) -> Result<(), CliError> {
        let selectors = match list {
            None | Some(DeviceList::All) => vec![None],
            Some(DeviceList::Named(named)) => named.iter().map(Some).collect(),
        };
        for selector in selectors {
            let device = chosen_device(selector)?;
            if device.is_software() {
                let best = if selector.is_none() { "no usable GPU found: " } else { "" };
                let name = device.name;
                return Err(CliError::NoGpu(format!(
                    "--require gpu: {best}{name} is a software driver; `kdray doctor` tells why there is no GPU"
                )));
            }
        }
        Ok(())
    }
}

/// Parses a device selector: an index if the word is a number, else a part of a name.
pub fn device(word: &str) -> Result<DeviceSelector, String> {
    match word.parse() {
        Ok(index) => Ok(DeviceSelector::Index(index)),
        Err(_) if word.trim().is_empty() => Err("expected an index or a name".into()),
        Err(_) => Ok(DeviceSelector::Name(word.to_owned())),
    }
}

/// Opens the selected device. If the user selected none and the best device is a software driver, a note says so, and
/// that the CPU is faster without it.
pub fn open_device(options: &ContextOptions, progress: &Progress) -> Result<Device, GpuError> {
    let device = Device::open(options)?;
    if options.device.is_none() && device.is_software() {
        progress.note(&software_note(&device.info().name));
    }
    Ok(device)
}

/// Returns the note for a machine whose best device is a software driver: `--cpu` is faster.
pub fn software_note(name: &str) -> String {
    format!("no GPU found, rendering in software on {name}, which is slower than --cpu")
}

/// Opens the devices of the list, or the best device if there is no list. If the devices differ in name or driver, a
/// note warns that they may round in different ways.
pub fn open_devices(list: Option<&DeviceList>, validate: bool, progress: &Progress) -> Result<Vec<Device>, GpuError> {
    let selectors = match list {
        None => vec![None],
        Some(DeviceList::Named(named)) => named.iter().cloned().map(Some).collect(),
        Some(DeviceList::All) => {
            let best = chosen_device(None)?;
            let is_like_best =
                |it: &DeviceInfo| it.missing.is_empty() && it.name == best.name && it.driver == best.driver;
            let alike = devices()?.into_iter().filter(is_like_best);
            alike.map(|it| Some(DeviceSelector::Index(it.index))).collect()
        }
    };
    let open = |selector| open_device(&ContextOptions::new(selector, validate), progress);
    let opened = selectors.into_iter().map(open).collect::<Result<Vec<_>, _>>()?;
    let kinds: BTreeSet<String> = opened.iter().map(|it| format!("{}, {}", it.info().name, it.info().driver)).collect();
    if kinds.len() > 1 {
        let kinds = kinds.into_iter().collect::<Vec<_>>().join("; ");
        progress.note(&format!("the devices are of several kinds, which may round in different ways: {kinds}"));
    }
    Ok(opened)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_devices() {
        let list = |word: &str| word.parse::<DeviceList>();
        let named = |word: &str| DeviceSelector::Name(word.to_owned());
        assert_eq!(list("all"), Ok(DeviceList::All));
        assert_eq!(list("0"), Ok(DeviceList::Named(vec![DeviceSelector::Index(0)])));
        assert_eq!(list("1,RTX"), Ok(DeviceList::Named(vec![DeviceSelector::Index(1), named("RTX")])));
        assert!(list("").is_err() && list("0,,1").is_err());
    }
}
