//! Tests of the three kinds of access to arrays that grow with the scene: bound storage, texels, or by address where
//! the device's limits exclude the other two. All give the same bits. The devices here overrides to have low limits.

use std::sync::Arc;

use glam::Vec3;
use kdray::{
    accel::{
        Query,
        kdtree::{KdTree, Traversal},
    },
    buffers::{AccelBuffers, SceneAccess, SceneArrays},
    cast::{GpuCaster, Ray},
    frame::{Primary, RenderOptions},
    gpu::{Buffer, BufferUse, Context, DeviceOverrides, GpuError},
    layout::{KdRope, LargeTriangle, LeafTriangle},
    render::GpuRenderer,
    world::World,
};

use super::studio::{assert_silent, device, identical, options, world_of};
use crate::support::{kept, meshes, pretended, scenes};

/// Largest range that the small device binds, in bytes. It is enough for the pictures here.
pub const RANGE: u64 = 48 << 10;

pub fn device_with(bytes: u64, n_texels: u32) -> Arc<Context> {
    pretended(DeviceOverrides { storage_range: Some(bytes), n_texels: Some(n_texels), ..DeviceOverrides::default() })
}

fn small_device() -> Arc<Context> {
    device_with(RANGE, 1)
}

/// Returns the number of texels of the largest array, which holds the ropes (one texel each) or the leaves' triangles
/// (three texels each).
fn most_texels(tree: &KdTree) -> u32 {
    (6 * tree.nodes().len()).max(3 * tree.leaf_triangles().len()) as u32
}

/// Returns how a device reads arrays that it can bind.
fn usual_reading(context: &Context, tree: &KdTree) -> SceneAccess {
    let has_texels = most_texels(tree) <= context.limits().n_texels;
    if context.predicates_branches() && has_texels { SceneAccess::Texels } else { SceneAccess::Bound }
}

/// Returns a world with a ring of 16,000 triangles, of which the small device can bind no array.
pub fn large_world() -> World {
    let mut scene = scenes::mixed();
    scenes::add(&mut scene, meshes::torus(200, 40), scenes::mirror(Vec3::splat(0.8)));
    // The small device has no room for the counters of the bounces that blended surfaces add.
    scene.materials.iter_mut().for_each(|material| material.d = 1.0);
    world_of(&scene)
}

/// Returns the size in bytes of each array that grows with the scene, including those that only this traversal needs.
fn scene_bytes(tree: &SceneArrays, traversal: Traversal) -> Vec<u64> {
    let mut buffers =
        vec![tree.triangles.any(), tree.triangle_materials.any(), tree.kd_nodes.any(), tree.leaf_triangles.any()];
    // An array that the kernels would not read is empty.
    buffers.extend((!tree.leaf_planes.is_empty()).then(|| tree.leaf_planes.any()));
    buffers.extend((!tree.kd_slabs.is_empty()).then(|| tree.kd_slabs.any()));
    let has_boxes = matches!(traversal, Traversal::MaskBoxes | Traversal::Backtrack);
    buffers.extend(has_boxes.then(|| tree.kd_links.any()));
    // The traversals that read boxes also walk up. The others need parents only where rays are suspended.
    buffers.extend((has_boxes || !tree.kd_parents.is_empty()).then(|| tree.kd_parents.any()));
    buffers.extend((traversal == Traversal::Ropes).then(|| tree.kd_links.any()));
    buffers.iter().map(|buffer| buffer.bytes()).collect()
}

#[test]
fn a_scene_larger_than_what_the_device_binds_gives_the_same_bits() {
    if kept::leaves_out("the sizes of one tree's arrays") {
        return;
    }
    let (world, any, small) = (large_world(), device(), small_device());
    for &traversal in Traversal::ALL {
        for primary in [Primary::Raster, Primary::Trace] {
            let pixel_aovs = traversal == Traversal::Mask;
            let options = RenderOptions { traversal, primary, pixel_aovs, ..options(24, 16, 3) };
            let [mut bound, mut by_address] =
                [&any, &small].map(|context| GpuRenderer::new(context.clone(), &world, &options).expect("a renderer"));
            assert_eq!(bound.resources().accel.access(), usual_reading(&any, world.tree()));
            assert_eq!(by_address.resources().accel.access(), SceneAccess::Address);
            let bytes = scene_bytes(&by_address.resources().accel.arrays, traversal);
            assert!(bytes.iter().all(|&bytes| bytes > RANGE), "{traversal}: {bytes:?}");
            let pictures = [&mut bound, &mut by_address].map(|renderer| renderer.render().expect("a frame").0);
            assert!(identical(&pictures[0], &pictures[1]), "{traversal} {primary}");
            if pixel_aovs {
                assert!(
                    bound.pixel_aovs().expect("pixel_aovs") == by_address.pixel_aovs().expect("pixel_aovs"),
                    "{primary}"
                );
            }
        }
    }
    assert_silent(&any);
    assert_silent(&small);
}

/// Together, these traversals read all arrays except slabs, which software drivers do not use. On a GPU, and where
/// there are few texels, both renderers use the same access.
#[test]
fn texels_and_what_is_bound_give_the_same_bits() {
    if kept::leaves_out("the sizes of one tree's arrays") {
        return;
    }
    let (world, any, bound) = (large_world(), device(), device_with(u64::MAX, 1));
    for traversal in [Traversal::Mask, Traversal::MaskBoxes, Traversal::Ropes] {
        let options = RenderOptions { traversal, primary: Primary::Trace, ..options(24, 16, 3) };
        let pictures =
            [(&any, usual_reading(&any, world.tree())), (&bound, SceneAccess::Bound)].map(|(context, reading)| {
                let mut renderer = GpuRenderer::new(context.clone(), &world, &options).expect("a renderer");
                assert_eq!(renderer.resources().accel.access(), reading);
                renderer.render().expect("a frame").0
            });
        assert!(identical(&pictures[0], &pictures[1]), "{traversal}");
    }
    assert_silent(&any);
    assert_silent(&bound);
}

/// The rasterizing kernels bind their list of large triangles. The triangles themselves need not be bound.
#[test]
fn triangles_that_are_not_bound_are_rasterized() {
    let (world, any) = (large_world(), device());
    if !any.has_int64_atomics() {
        return;
    }
    let options = RenderOptions { primary: Primary::SoftwareRaster, ..options(24, 16, 2) };
    // The state of the queue takes 32 bytes.
    let n_bytes = (world.scene().triangles.len() * size_of::<LargeTriangle>()) as u64 + 32;
    let with_range = |bytes| GpuRenderer::new(device_with(bytes, 1), &world, &options);
    let mut by_address = with_range(n_bytes).expect("a renderer");
    assert_eq!(by_address.resources().accel.access(), SceneAccess::Address);
    let mut bound = GpuRenderer::new(any.clone(), &world, &options).expect("a renderer");
    let pictures = [&mut bound, &mut by_address].map(|renderer| renderer.render().expect("a frame").0);
    assert!(identical(&pictures[0], &pictures[1]));
    let too_small = with_range(n_bytes - 1).err().expect("no room").to_string();
    assert!(too_small.starts_with("`raster_groups` takes"), "{too_small}");
    assert_silent(&any);
}

#[test]
fn another_traversal_of_a_renderer_that_is_there_reads_by_address_too() {
    let (world, small) = (large_world(), small_device());
    let start = options(24, 16, 3);
    let mut renderer = GpuRenderer::new(small.clone(), &world, &start).expect("a renderer");
    let picture = renderer.render().expect("a frame").0;
    for traversal in [Traversal::Ropes, Traversal::MaskBoxes] {
        renderer.set_options(&RenderOptions { traversal, ..start.clone() }).expect("options");
        assert!(identical(&picture, &renderer.render().expect("a frame").0), "{traversal}");
    }
    assert_silent(&small);
}

#[test]
fn rays_through_a_scene_larger_than_what_the_device_binds_find_the_same_hits() {
    let (world, any, small) = (large_world(), device(), small_device());
    let towards = |i: u16| Vec3::new((f32::from(i) * 0.7).sin(), (f32::from(i) * 0.31).cos(), -0.4);
    let ray = |i| Ray { origin: Vec3::new(0.1, 0.2, 0.3), t_min: 0.0, direction: towards(i), t_max: f32::INFINITY };
    let rays: Vec<_> = (0..3000).map(ray).collect();
    for (traversal, query) in [
        (Traversal::Mask, Query::Closest),
        (Traversal::Mask, Query::Any),
        (Traversal::Stack, Query::Closest),
        (Traversal::Stack, Query::Any),
    ] {
        let hits = [&any, &small].map(|context| {
            let mut caster = GpuCaster::new(context, world.geometry(), traversal).expect("a caster");
            caster.cast(&rays, query, 1).expect("a cast").hits
        });
        assert!(hits[0].iter().any(|hit| hit.t.is_finite()));
        let nans = hits.each_ref().map(|hits| hits.iter().filter(|hit| hit.u.is_nan()).count());
        let differing = hits[0].iter().zip(&hits[1]).filter(|(a, b)| a != b).count();
        assert_eq!((differing, nans), (0, [0; 2]), "{traversal} {query:?}");
    }
    assert_silent(&any);
    assert_silent(&small);
}

/// If a single array is beyond the range, even one that only another traversal reads, all arrays are read by address.
/// If the device has one texel too few, all are read as bound storage.
#[test]
fn a_scene_is_read_by_address_only_where_something_of_it_cannot_be_bound() {
    if kept::leaves_out("the sizes of one tree's arrays") {
        return;
    }
    let scene = scenes::mixed();
    let world = world_of(&scene);
    let tree = world.tree();
    let ropes = (6 * tree.nodes().len() * size_of::<KdRope>()) as u64;
    let planes = size_of_val(tree.leaf_planes()) as u64;
    let leaf_triangles = (tree.leaf_triangles().len() * size_of::<LeafTriangle>()) as u64;
    let largest = leaf_triangles.max(size_of_val(&*scene.triangles) as u64).max(planes).max(ropes);
    let most_texels = most_texels(tree);
    let usual = usual_reading(&device(), tree);
    for (range, n_texels, reading) in [
        (largest - 1, 1, SceneAccess::Address),
        (largest, 1, SceneAccess::Bound),
        (largest, most_texels - 1, SceneAccess::Bound),
        (largest, most_texels, usual),
    ] {
        let context = device_with(range, n_texels);
        let made = AccelBuffers::new(&context, world.geometry()).expect("a tree");
        assert_eq!(made.access(), reading, "{range} bytes, {n_texels} texels");
        assert_silent(&context);
    }
}

/// The small device must refuse buffers beyond its range; otherwise the tests with it would prove nothing.
#[test]
fn what_is_bound_is_held_against_the_range() {
    let (world, small) = (large_world(), small_device());
    let capacity = RANGE as u32;
    let queues = GpuRenderer::with_queue_capacity(small.clone(), &world, &options(8, 8, 2), capacity);
    assert!(matches!(queues.err(), Some(GpuError::TooLarge { limit: RANGE, .. })));
    let buffer = |len, usage| Buffer::<u32>::new(&small, "words", len, usage).err().map(|error| error.to_string());
    let n_words = RANGE as usize / 4;
    assert_eq!(buffer(n_words, BufferUse::Storage), None);
    assert_eq!(buffer(n_words + 1, BufferUse::Address), None);
    let beyond = "`words` takes 0.0 MiB, more than this device's limit of 0.0 MiB";
    assert_eq!(buffer(n_words + 1, BufferUse::Storage).as_deref(), Some(beyond));
}

#[test]
fn a_buffer_larger_than_the_devices_memory_is_refused_in_one_line() {
    let context = device();
    let n_words = context.limits().buffer_bytes as usize / 4 + 1;
    let error = Buffer::<u32>::new(&context, "words", n_words, BufferUse::Address).err().expect("no such buffer");
    assert!(matches!(error, GpuError::TooLarge { .. }) && !error.to_string().contains('\n'), "{error}");
    assert_silent(&context);
}

/// A large upload is made in parts, each of whole elements.
#[test]
fn a_large_upload_arrives_whole() {
    let context = device();
    let numbers: Vec<[u32; 3]> = (0..(65 << 20) / 12).map(|ix| [ix, ix + 1, ix + 2]).collect();
    let buffer = Buffer::with(&context, "numbers", &numbers, BufferUse::Storage).expect("a buffer");
    assert!(buffer.download().expect("a download") == numbers);
    assert_silent(&context);
}
