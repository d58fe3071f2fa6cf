//! Casts a grid of rays at a scene from its camera, and prints what they hit as characters.
//!
//! ```sh
//! cargo run --release --example cast -- scenes/cornell.toml
//! ```

use std::{env, error::Error, path::Path};

use kdray::{
    accel::Query,
    cast::{NO_TRIANGLE, Ray},
    engine::{Engine, LoadRequest},
    gpu::ContextOptions,
    scene::{Camera, Projection},
};

/// Numbers of columns and rows of characters.
const SIZE: (u32, u32) = (64, 28);

fn main() -> Result<(), Box<dyn Error>> {
    let path = env::args_os().nth(1).ok_or("usage: cast SCENE")?;
    // Only a machine without a Vulkan driver casts on the CPU: any other error is one.
    let engine = match Engine::open(&ContextOptions::default()) {
        Err(error) if error.is_without_driver() => {
            eprintln!("{error}; casting on the CPU");
            Engine::on_cpu()
        }
        opened => opened?,
    };
    let request = LoadRequest::rays(u64::from(SIZE.0 * SIZE.1));
    let world = engine.load(Path::new(&path), &request)?.world;
    let places = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y)));
    let rays: Vec<_> = places.map(|(x, y)| ray(&world.scene().camera, x, y)).collect();
    let hits = engine.cast(&world, &rays, Query::Closest)?;
    for row in hits.chunks(SIZE.0 as usize) {
        let letter = |material: u32| char::from(b'a' + (material % 26) as u8);
        let of_hit = |triangle_ix: u32| match triangle_ix {
            NO_TRIANGLE => ' ',
            _ => letter(world.scene().material_ix_of(triangle_ix as usize)),
        };
        println!("{}", row.iter().map(|hit| of_hit(hit.triangle_ix)).collect::<String>());
    }
    Ok(())
}

/// Returns the ray through the centre of a character, which is twice as high as it is wide.
fn ray(camera: &Camera, x: u32, y: u32) -> Ray {
    let forward = (camera.target - camera.eye).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let half_height = camera.height_at(1.0) / 2.0;
    let half_width = half_height * SIZE.0 as f32 / (2 * SIZE.1) as f32;
    let across = (2.0 * (x as f32 + 0.5) / SIZE.0 as f32 - 1.0) * half_width;
    let above = (1.0 - 2.0 * (y as f32 + 0.5) / SIZE.1 as f32) * half_height;
    let in_picture = across * right + above * up;
    let (origin, direction) = match camera.projection {
        Projection::Perspective { .. } => (camera.eye, (forward + in_picture).normalize()),
        Projection::Orthographic { .. } => (camera.eye + in_picture, forward),
    };
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}
