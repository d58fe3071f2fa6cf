//! What grows with the scene is read by address: it may be larger than what the device binds. Tried with a device that
//! binds little.

use std::sync::Arc;

use glam::Vec3;
use kdray::{
    cast::{CastRay, Caster, Query},
    frame::{RenderOptions, Traversal},
    gpu::{Binding, BindingKind, BindingSet, Bindings, Buffer, BufferUse, Context, ContextOptions, GpuError},
    render::Renderer,
    scene::Scene,
};

use super::studio::{assert_silent, device, identical, options, tree_of};
use crate::support::{meshes, scenes};

/// What the device binds, bytes: enough for the pictures here.
const RANGE: u64 = 16 << 10;

fn small_device() -> Arc<Context> {
    let options = ContextOptions { device: None, validate: true };
    Context::with_storage_range(&options, RANGE).expect("a device with validation")
}

/// With a ring of 6400 triangles.
fn scene() -> Scene {
    let mut scene = scenes::mixed();
    scenes::add(&mut scene, meshes::torus(80, 40), scenes::mirror(Vec3::splat(0.8)));
    scene
}

/// Bytes of each buffer that grows with the scene, with whatever the traversal asks for.
fn scene_bytes(renderer: &Renderer, traversal: Traversal) -> Vec<u64> {
    let (resources, tree) = (renderer.resources(), &renderer.resources().tree);
    let mut buffers = vec![
        resources.triangle_materials.any(),
        tree.triangles.any(),
        tree.kd_nodes.any(),
        tree.kd_parents.any(),
        tree.leaf_triangles.any(),
        tree.leaf_planes.any(),
    ];
    let has_boxes = matches!(traversal, Traversal::MaskBoxes | Traversal::Backtrack | Traversal::Ropes);
    buffers.extend(has_boxes.then(|| tree.kd_boxes.any()));
    buffers.extend((traversal == Traversal::Ropes).then(|| tree.kd_ropes.any()));
    buffers.iter().map(|buffer| buffer.bytes()).collect()
}

#[test]
fn a_scene_larger_than_what_the_device_binds_gives_the_same_bits() {
    let (scene, any, small) = (scene(), device(), small_device());
    let tree = tree_of(&scene);
    for &traversal in Traversal::ALL {
        let options = RenderOptions { traversal, ..options(32, 24, 3) };
        let render = |context: &Arc<Context>| {
            let mut renderer = Renderer::new(context.clone(), &scene, &tree, &options).expect("a renderer");
            let picture = renderer.render().expect("a frame").0;
            (picture, scene_bytes(&renderer, traversal))
        };
        let ((whole, _), (picture, bytes)) = (render(&any), render(&small));
        assert!(bytes.iter().all(|&bytes| bytes > RANGE), "{traversal}: {bytes:?}");
        assert!(identical(&whole, &picture), "{traversal}");
    }
    assert_silent(&any);
    assert_silent(&small);
}

#[test]
fn rays_through_a_scene_larger_than_what_the_device_binds_find_the_same_hits() {
    let (scene, any, small) = (scene(), device(), small_device());
    let tree = tree_of(&scene);
    let towards = |i: u16| Vec3::new((f32::from(i) * 0.7).sin(), (f32::from(i) * 0.31).cos(), -0.4);
    let ray = |i| CastRay { origin: Vec3::new(0.1, 0.2, 0.3), t_min: 0.0, direction: towards(i), t_max: f32::INFINITY };
    let rays: Vec<_> = (0..3000).map(ray).collect();
    let cast = |context| {
        let mut caster = Caster::new(context, &scene.triangles, &tree, Traversal::Mask).expect("a caster");
        caster.cast(&rays, Query::Closest, 1).expect("a cast").hits
    };
    let hits = cast(&any);
    assert!(hits.iter().any(|hit| hit.t.is_finite()));
    assert_eq!(hits, cast(&small));
    assert_silent(&small);
}

/// Without these, the small device would prove nothing.
#[test]
fn what_is_bound_is_held_against_the_range() {
    let (scene, small) = (scene(), small_device());
    let capacity = RANGE as u32;
    let queues = Renderer::with_queue_capacity(small.clone(), &scene, &tree_of(&scene), &options(8, 8, 2), capacity);
    assert!(matches!(queues.err(), Some(GpuError::TooLarge { limit: RANGE, .. })));
    let buffer = |len, usage| Buffer::<u32>::new(&small, "words", len, usage).err().map(|error| error.to_string());
    let n_words = RANGE as usize / 4;
    assert_eq!(buffer(n_words, BufferUse::Storage), None);
    assert_eq!(buffer(n_words + 1, BufferUse::Address), None);
    let beyond = "`words` takes 0.0 MiB, more than this device's limit of 0.0 MiB";
    assert_eq!(buffer(n_words + 1, BufferUse::Storage).as_deref(), Some(beyond));
}

#[test]
fn what_is_read_by_address_cannot_be_bound() {
    for (usage, n_messages) in [(BufferUse::Storage, 0), (BufferUse::Address, 1)] {
        let context = device();
        let words = Buffer::with(&context, "words", &[1u32, 2], usage).expect("a buffer");
        let bindings = Bindings::new(&context, &[(0, BindingKind::Storage)], 4).expect("bindings");
        let _set = BindingSet::new(&bindings, "set", &[(0, Binding::Buffer(words.any()))]).expect("a set");
        assert_eq!(context.validation_messages().len(), n_messages, "{usage:?}");
    }
}

#[test]
fn a_buffer_larger_than_the_devices_memory_is_refused_in_one_line() {
    let context = device();
    let n_words = context.limits().buffer_bytes as usize / 4 + 1;
    let error = Buffer::<u32>::new(&context, "words", n_words, BufferUse::Address).err().expect("no such buffer");
    assert!(matches!(error, GpuError::TooLarge { .. }) && !error.to_string().contains('\n'), "{error}");
    assert_silent(&context);
}

/// Uploads come in parts.
#[test]
fn a_large_upload_arrives_whole() {
    let context = device();
    let numbers: Vec<u32> = (0..(65 << 20) / 4).collect();
    let buffer = Buffer::with(&context, "numbers", &numbers, BufferUse::Storage).expect("a buffer");
    assert!(buffer.download().expect("a download") == numbers);
    assert_silent(&context);
}
