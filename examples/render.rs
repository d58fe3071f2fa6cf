//! Renders a scene file to a PNG.
//!
//! ```sh
//! cargo run --release --example render -- scenes/cornell.toml cornell.png
//! ```

use std::{env, error::Error, path::PathBuf};

use kdray::{
    engine::{Built, Engine, choices::Workload},
    gpu::ContextOptions,
    output,
    scene::Scene,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args_os().skip(1).map(PathBuf::from);
    let (Some(scene), Some(picture)) = (arguments.next(), arguments.next()) else {
        return Err("usage: render SCENE PICTURE".into());
    };
    let scene = Scene::load(&scene)?;
    let options = scene.defaults.options();
    // The engine chooses a tree that suits the number of rays.
    let workload = Workload::of_pictures(&options, scene.lights.len(), 1);
    // Only a machine without a Vulkan driver renders on the CPU: any other error is one.
    let engine = match Engine::open(&ContextOptions::default()) {
        Err(error) if error.is_without_driver() => {
            eprintln!("{error}; rendering on the CPU");
            Engine::on_cpu()
        }
        opened => opened?,
    };
    let Built { world, .. } = engine.build(scene, &workload)?;
    let rendered = engine.render(&world, &options)?;
    output::write_picture(&picture, &rendered.picture)?;
    println!("{} on {}", picture.display(), engine.device_name());
    Ok(())
}
