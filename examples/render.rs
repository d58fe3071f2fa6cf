//! Renders a scene file to a PNG.
//!
//! ```sh
//! cargo run --release --example render -- scenes/cornell.toml cornell.png
//! ```

use std::{env, error::Error, path::PathBuf};

use kdray::{
    engine::{Engine, LoadRequest},
    gpu::ContextOptions,
    output,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args_os().skip(1).map(PathBuf::from);
    let (Some(scene), Some(picture)) = (arguments.next(), arguments.next()) else {
        return Err("usage: render SCENE PICTURE".into());
    };
    // Only a machine without a Vulkan driver renders on the CPU: any other error is one.
    let engine = match Engine::open(&ContextOptions::default()) {
        Err(error) if error.is_without_driver() => {
            eprintln!("{error}; rendering on the CPU");
            Engine::on_cpu()
        }
        opened => opened?,
    };
    let loaded = engine.load(&scene, &LoadRequest::default())?;
    loaded.notes.iter().for_each(|note| eprintln!("{note}"));
    let rendered = engine.render(&loaded.world, &loaded.options)?;
    output::write_picture(&picture, &rendered.picture)?;
    println!("{} on {}", picture.display(), engine.device_name());
    Ok(())
}
