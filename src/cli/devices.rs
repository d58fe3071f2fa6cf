//! `kdray devices`: lists the Vulkan devices of this machine.

use kdray::gpu;

use super::{error::CliError, print, table::table};

/// Lists the devices. For a device that cannot render, names the features that it lacks.
pub fn run() -> Result<(), CliError> {
    let devices = gpu::devices()?;
    let rows: Vec<_> = (devices.iter())
        .map(|device| {
            let index = device.index.to_string();
            let subgroup = device.subgroup_size.to_string();
            [
                index,
                device.name.clone(),
                device.kind.clone(),
                device.api_version.clone(),
                subgroup,
                device.driver.clone(),
            ]
        })
        .collect();
    let mut text = table(["device", "name", "kind", "Vulkan", "subgroup", "driver"], &rows);
    for device in devices.iter().filter(|device| !device.missing.is_empty()) {
        text += &format!("device {} cannot render, it lacks: {}\n", device.index, device.missing.join(", "));
    }
    print(&text)
}
