//! Pictures of instances, beside those of their flattened copies.

use std::sync::Arc;

use glam::{DQuat, DVec3, Vec3};
use kdray::{
    accel::kdtree::Traversal,
    cpu,
    frame::{Denoise, Integrator, Picture, Primary, RenderOptions},
    gpu::Context,
    render::GpuRenderer,
    scene::{Instance, Light, Material, Scene, Transform},
    world::World,
};

use super::{ball, flattened, kept, mesh_of};
use crate::support::{assert_silent, device, textured};

/// Every kind of texture and material, and more instances of the same meshes: turned, mirrored and stretched.
pub fn scene() -> Scene {
    let mut scene = textured::scene_of_every_kind();
    let turn = DQuat::from_rotation_y(0.6) * DQuat::from_rotation_x(0.3);
    let more = [
        (1, DVec3::new(-0.4, 0.4, 0.4), DVec3::new(-0.2, 1.4, -0.5)),
        (1, DVec3::new(0.3, 0.6, 0.3), DVec3::new(1.6, 0.9, -0.8)),
        (5, DVec3::new(0.5, -0.5, 0.5), DVec3::new(-1.6, -0.6, 1.1)),
        (7, DVec3::new(0.4, 0.3, -0.5), DVec3::new(0.7, -0.8, 1.3)),
    ];
    for (instance_ix, scale, at) in more {
        let Instance { mesh_ix, mut materials, .. } = scene.instances[instance_ix].clone();
        // Rays of the camera pass through the back faces of one.
        if instance_ix == 5 {
            let single = Material { is_double_sided: false, ..scene.materials[materials[0] as usize].clone() };
            scene.materials.push(single);
            materials = vec![scene.materials.len() as u32 - 1];
        }
        let transform = Transform::new(scale, turn, at).expect("a transform");
        scene.instances.push(Instance { mesh_ix, materials, transform, ..Instance::default() });
    }
    scene
}

pub fn options() -> RenderOptions {
    RenderOptions { width: 96, height: 72, max_depth: 4, denoise: Denoise::Off, ..RenderOptions::default() }
}

pub fn on_device(context: &Arc<Context>, world: &World, options: &RenderOptions) -> Picture {
    let mut renderer = GpuRenderer::new(context.clone(), world, options).expect("a renderer");
    let picture = renderer.render().expect("a frame").0;
    assert_silent(context);
    picture
}

/// Asserts that at most a share of the pixels differs visibly.
fn assert_alike(what: &str, a: &Picture, b: &Picture, share: f64) {
    let differs = |(a, b): (&[f32; 4], &[f32; 4])| (0..4).any(|i| !((a[i] - b[i]).abs() <= 0.004 + 0.01 * a[i].abs()));
    let n_differing = a.radiance.iter().zip(&b.radiance).filter(|pair| differs(*pair)).count();
    let n_allowed = (share * a.radiance.len() as f64) as usize;
    assert!(n_differing <= n_allowed, "{what}: {n_differing} of {} pixels differ", a.radiance.len());
    let n_lit = a.radiance.iter().filter(|pixel| pixel[0] + pixel[1] + pixel[2] > 0.02).count();
    assert!(n_lit > a.radiance.len() / 2, "{what}: most of the picture is dark");
}

#[test]
fn instances_look_like_their_flattened_copies() {
    let scene = scene();
    let (kept, flat) = (kept(&scene), flattened(&scene));
    let context = device();
    for primary in [Primary::Trace, Primary::Raster] {
        for traversal in [Traversal::Mask, Traversal::Ropes] {
            let options = RenderOptions { primary, traversal, ..options() };
            let pictures = [&kept, &flat].map(|world| on_device(&context, world, &options));
            let share = if primary == Primary::Raster { 0.03 } else { 0.01 };
            assert_alike(&format!("{primary}, {traversal}"), &pictures[1], &pictures[0], share);
        }
    }
    let pictures = [&kept, &flat].map(|world| cpu::render(world, &options()).0);
    assert_alike("the CPU", &pictures[1], &pictures[0], 0.01);
    // A renderer that goes over to another way.
    let mut renderer =
        GpuRenderer::new(context.clone(), &kept, &RenderOptions { primary: Primary::Trace, ..options() }).unwrap();
    renderer.draw().unwrap();
    renderer.set_options(&RenderOptions { primary: Primary::Raster, ..options() }).unwrap();
    assert_alike("traced, then rasterized", &pictures[0], &renderer.render().unwrap().0, 0.03);
    drop(renderer);
    let on_device = on_device(&context, &kept, &RenderOptions { primary: Primary::Trace, ..options() });
    assert_alike("device and CPU", &pictures[0], &on_device, 0.01);
}

/// The scene, lit by triangles that shine, in two instances, and by a point.
pub fn scene_of_lamps() -> Scene {
    let mut scene = scene();
    let lamp = Material { name: "lamp".to_owned(), ke: Vec3::new(6.0, 5.0, 4.0), ..Material::default() };
    scene.materials.push(lamp);
    scene.meshes.push(mesh_of(&ball()));
    for at in [DVec3::new(-1.5, 1.8, 0.3), DVec3::new(1.4, 1.7, 0.2)] {
        let transform =
            Transform::new(DVec3::new(0.2, 0.1, -0.3), DQuat::from_rotation_z(0.4), at).expect("a transform");
        let materials = vec![scene.materials.len() as u32 - 1];
        scene.instances.push(Instance { mesh_ix: scene.meshes.len() - 1, transform, materials, ..Instance::default() });
    }
    scene.lights = vec![Light::Point { position: Vec3::new(2.0, 2.5, 3.0), intensity: Vec3::ONE }];
    scene
}

#[test]
fn paths_through_instances_are_those_through_their_copies() {
    let scene = scene_of_lamps();
    let (kept, flat) = (kept(&scene), flattened(&scene));
    let context = device();
    let options = RenderOptions { integrator: Integrator::Path, primary: Primary::Trace, ..options() };
    // All random numbers are the same, so that only rounding at edges sends a path elsewhere.
    let pictures = [&kept, &flat].map(|world| on_device(&context, world, &options));
    assert_alike("the device", &pictures[1], &pictures[0], 0.03);
    let pictures = [&kept, &flat].map(|world| cpu::render(world, &options).0);
    assert_alike("the CPU", &pictures[1], &pictures[0], 0.03);
}
