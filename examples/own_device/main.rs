//! Renders inside a program that has a Vulkan device of its own, into one of the program's images. A timeline
//! semaphore orders the commands of the program and of kdray on the device.
//!
//! ```sh
//! cargo run --release --example own_device -- scenes/cornell.toml picture.png
//! ```

mod program;
mod target;

use std::{env, error::Error, path::PathBuf};

use ash::vk;
use kdray::{
    engine::{Engine, LoadRequest, Loaded, Opened, Work},
    frame::Goal,
    gpu::{Device, ExternalImage, TimelinePoint},
};
use program::Program;
use target::Target;

/// Values of the timeline semaphore, in order: after the program has cleared the image, after kdray has written it,
/// and after the program has read it.
const CLEARED: u64 = 1;
const WRITTEN: u64 = 2;
const READ: u64 = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args_os().skip(1).map(PathBuf::from);
    let (Some(scene), Some(picture)) = (arguments.next(), arguments.next()) else {
        return Err("usage: own_device SCENE PICTURE".into());
    };
    let opened = Opened::read(&scene, &LoadRequest::default())?;
    let (width, height) = (opened.options.width, opened.options.height);
    // SAFETY: the program destroys what it has made after kdray's objects are gone and the device is idle.
    unsafe {
        let program = Program::new()?;
        let target = Target::new(&program, width, height)?;
        program.submit(&target.clear, None, Some(CLEARED))?;
        render(&program, &target, opened, (width, height))?;
        program.submit(&target.read_back, Some(WRITTEN), Some(READ))?;
        program.wait_for(READ)?;
        let pixels = target.pixels(&program)?;
        image::save_buffer(&picture, &pixels, width, height, image::ColorType::Rgba8)?;
        target.destroy(&program);
        program.destroy();
    }
    println!("{}", picture.display());
    Ok(())
}

/// Draws the scene with kdray, and writes the picture into the target.
unsafe fn render(program: &Program, target: &Target, opened: Opened, size: (u32, u32)) -> Result<(), Box<dyn Error>> {
    // SAFETY: the handles are the program's, which lives longer than the device handle; it has one thread.
    let (device, image, [cleared, written]) = unsafe {
        let layouts = [vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL];
        (
            Device::external(program.external())?,
            ExternalImage::new(target.image, size, layouts),
            [CLEARED, WRITTEN].map(|value| TimelinePoint::new(program.timeline, value)),
        )
    };
    let engine = Engine::on_device(device);
    let (Loaded { world, options, .. }, methods) = engine.build(opened, &Work::picture())?;
    let options = methods.apply(&options);
    let mut renderer = engine.renderer(&world, &options)?;
    renderer.draw(&world.scene().camera, Goal::Samples(1), || ())?;
    renderer.copy_picture_to(&image, Some(cleared), Some(written))?;
    Ok(())
}
