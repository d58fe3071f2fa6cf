//! Tests that pictures do not depend on the GLSL compiler: the system's library and the one built from source give
//! the same pictures.

use std::path::Path;

use kdray::{
    frame::{Picture, Primary, RenderOptions},
    render::GpuRenderer,
    world::FlatScene,
};

use super::studio::{assert_silent, device, differing, on_cpu, options, world_of};
use crate::support::scenes;

/// Part of a driver's device name, and its checksums of `cornell` and `paper2`. They must be the same with the
/// feature `shaderc-from-source` and without it. A change of a kernel's arithmetic changes them. Lavapipe gives the
/// same checksums with registers of 128 bits and of 256 bits.
const CHECKSUMS: [(&str, [u32; 2]); 2] =
    [("llvmpipe", [496181928, 4173488160]), ("SwiftShader", [2091055692, 2951166449])];

/// Returns the CRC-32 of the displayed pixels.
fn checksum(picture: &Picture) -> u32 {
    crc32fast::hash(picture.display.as_flattened())
}

fn scene(name: &str) -> FlatScene {
    scenes::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name))
}

#[test]
fn pictures_are_the_same_whichever_compiler_made_the_kernels() {
    let context = device();
    let name = &context.info().name;
    let known = CHECKSUMS.iter().find(|(driver, _)| name.contains(driver)).map(|(_, checksums)| *checksums);
    let scenes = ["cornell.toml", "paper2.toml"].map(scene);
    let options = scenes
        .each_ref()
        .map(|scene| RenderOptions { primary: Primary::Trace, ..options(96, 72, scene.defaults.max_depth) });
    let pictures: [Picture; 2] = std::array::from_fn(|i| {
        let renderer = GpuRenderer::new(context.clone(), &world_of(&scenes[i]), &options[i]);
        renderer.expect("a renderer").render().expect("a frame").0
    });
    assert_silent(&context);
    match known {
        Some(expected) => {
            let found = pictures.each_ref().map(checksum);
            assert_eq!(found, expected, "{name}, kernels of {}", env!("KDRAY_SPIRV_COMPILER"));
        }
        // Another device may round differently, so a few pixels may differ from the CPU's.
        None => (0..2).for_each(|i| {
            let n_differing = differing(&pictures[i], &on_cpu(&scenes[i], &options[i]), 2e-3).len();
            assert!(n_differing <= 20, "{name}: {n_differing} of 6912 pixels differ from the CPU's");
        }),
    }
}

#[test]
fn one_changed_pixel_changes_the_checksum() {
    let picture = on_cpu(&scene("cornell.toml"), &options(16, 12, 2));
    let mut changed = picture.clone();
    changed.display[77][1] ^= 1;
    assert_ne!(checksum(&picture), checksum(&changed));
}
