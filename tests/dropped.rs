//! Whatever a program drops, and in whatever order, the device finds what it reads. Each buffer has memory of its own
//! here, which is overwritten when it is released, and the validation layer tracks all objects.

mod support;

#[path = "../examples/own_device/program.rs"]
mod program;
#[path = "../examples/own_device/target.rs"]
mod target;

use std::{any::Any, env, process::Command, thread, time::Duration};

use ash::vk;
use glam::Vec3;
use kdray::{
    accel::{Query, kdtree::Traversal},
    cast::{GpuCaster, Hit, NO_TRIANGLE, Ray},
    engine::Engine,
    frame::{Goal, RenderOptions},
    gpu::{Context, Device, DeviceOverrides, ExternalBuffer, ExternalCommands, ExternalImage, TimelinePoint},
};
use program::Program;
use support::{scenes, world_of};
use target::Target;

/// Values of the program's timeline: the image is cleared, the device may copy the picture into it, has copied it, and
/// has read it back.
const CLEARED: u64 = 1;
const MAY_COPY: u64 = 2;
const COPIED: u64 = 3;
const READ: u64 = 4;

/// Messages about the layer itself. On a busy machine, version 1.3.239 misses a value that the host signals while one
/// of its threads begins to wait for it. After ten seconds it says so, of the semaphore and of the fence of that work,
/// and that this "is most likely a validation bug".
const MISSED_SIGNAL: [&str; 2] = ["UNASSIGNED-VkSemaphore-state-timeout", "UNASSIGNED-VkFence-state-timeout"];

/// Runs an ignored test of this file in a process of its own, under the validation layer, which prints its messages.
fn run_validated(test: &str) {
    let output = Command::new(env::current_exe().expect("this program"))
        .args([test, "--exact", "--ignored", "--nocapture"])
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT")
        .output()
        .expect("the test runs");
    let [printed, errors] = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success() && printed.contains("1 passed"), "{printed}{errors}");
    let is_message =
        |line: &str| line.contains("Validation") && !MISSED_SIGNAL.iter().any(|missed| line.contains(missed));
    assert!(!printed.lines().chain(errors.lines()).any(is_message), "{printed}{errors}");
}

/// All orders of `n` things.
fn orders(n: usize) -> Vec<Vec<usize>> {
    if n == 0 {
        return vec![Vec::new()];
    }
    let insert = |order: Vec<usize>| (0..n).map(move |place| [&order[..place], &[n - 1], &order[place..]].concat());
    orders(n - 1).into_iter().flat_map(insert).collect()
}

/// Opens the program's device for kdray, in the mode in which released memory is overwritten.
///
/// # Safety
/// The program outlives the device.
unsafe fn device(program: &Program) -> Device {
    let overrides = DeviceOverrides { marks_released: true, ..DeviceOverrides::default() };
    // SAFETY: the handles are the program's, and its queue has a lock of its own.
    unsafe { Context::on_external(program.external(), &overrides) }.expect("the program's device").into()
}

#[test]
fn a_picture_is_copied_whatever_is_dropped() {
    run_validated("pictures_that_are_being_copied");
}

/// The copy of a picture waits for the program while the renderer, the engine, the world and the device are dropped.
#[test]
#[ignore = "runs in a process of its own"]
fn pictures_that_are_being_copied() {
    let options = RenderOptions { width: 24, height: 16, max_depth: 2, ..RenderOptions::default() };
    let mut pictures = Vec::new();
    for order in orders(4) {
        // SAFETY: the program waits for all work before it destroys its objects.
        unsafe {
            let program = Program::new().expect("a device");
            let target = Target::new(&program, options.width, options.height).expect("an image");
            program.submit(&target.clear, None, Some(CLEARED)).expect("a submit");
            program.wait_for(CLEARED).expect("a cleared image");
            let device = device(&program);
            let layouts = [vk::ImageLayout::TRANSFER_DST_OPTIMAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL];
            let image = ExternalImage::new(target.image, (options.width, options.height), layouts);
            let point = |value| TimelinePoint::new(program.timeline, value);
            let engine = Engine::on_device(&device);
            let world = world_of(&scenes::mixed());
            let mut renderer = engine.renderer(&world, &options).expect("a renderer");
            renderer.draw(&world.scene().camera, Goal::Samples(1), || ()).expect("a sample");
            renderer.copy_picture_to(&image, Some(point(MAY_COPY)), Some(point(COPIED))).expect("a copy");
            let mut all: [Option<Box<dyn Any + Send>>; 4] =
                [Some(Box::new(renderer)), Some(Box::new(engine)), Some(Box::new(world)), Some(Box::new(device))];
            // The last handle waits for the copy, which waits for the program.
            let dropping = thread::spawn(move || order.iter().for_each(|&ix| drop(all[ix].take())));
            // The layer's thread, too, should wait by then.
            thread::sleep(Duration::from_millis(100));
            let may_copy = vk::SemaphoreSignalInfo::default().semaphore(program.timeline).value(MAY_COPY);
            program.device.signal_semaphore(&may_copy).expect("a signal");
            dropping.join().expect("no panic");
            program.submit(&target.read_back, Some(COPIED), Some(READ)).expect("a submit");
            program.wait_for(READ).expect("the end");
            pictures.push(target.pixels(&program).expect("pixels"));
            target.destroy(&program);
            program.destroy();
        }
    }
    assert!(pictures.iter().all(|picture| *picture == pictures[0]), "the order changes nothing");
    assert!(pictures[0].chunks(4).any(|pixel| pixel != &pictures[0][..4]), "the picture shows something");
}

#[test]
fn a_recorded_cast_keeps_what_it_reads() {
    run_validated("casts_that_are_recorded");
}

/// Everything but the recorded cast is dropped before its commands are recorded and run.
#[test]
#[ignore = "runs in a process of its own"]
fn casts_that_are_recorded() {
    let scene = scenes::mixed();
    let (eye, towards) = (scene.camera.eye, scene.camera.target - scene.camera.eye);
    let direction = |i: usize| towards + 0.01 * Vec3::new((i % 7) as f32, (i % 5) as f32, 0.0);
    let ray = |i| Ray { origin: eye, t_min: 0.0, direction: direction(i), t_max: f32::INFINITY };
    let rays: Vec<Ray> = (0..64).map(ray).collect();
    let mut all_hits = Vec::new();
    for order in orders(4) {
        // SAFETY: the program waits for all work before it destroys its objects.
        unsafe {
            let program = Program::new().expect("a device");
            let [(ray_buffer, ray_memory), (hit_buffer, hit_memory)] =
                [size_of::<Ray>(), size_of::<Hit>()].map(|bytes| buffer(&program, 64 * bytes));
            write(&program, ray_memory, bytemuck::cast_slice(&rays));
            let device = device(&program);
            let engine = Engine::on_device(&device);
            let world = world_of(&scene);
            let mut caster = GpuCaster::new(&device, world.geometry(), Traversal::Mask).expect("a caster");
            let external = |raw, bytes: usize| ExternalBuffer::new(raw, 0, 64 * bytes as u64);
            let (from, to) = (external(ray_buffer, size_of::<Ray>()), external(hit_buffer, size_of::<Hit>()));
            let cast = caster.recorded(from, to, Query::Closest).expect("a recorded cast");
            let mut all: [Option<Box<dyn Any>>; 4] =
                [Some(Box::new(caster)), Some(Box::new(world)), Some(Box::new(engine)), Some(Box::new(device))];
            order.iter().for_each(|&ix| drop(all[ix].take()));
            let commands = program.record(|commands| cast.record(&ExternalCommands::new(commands))).expect("commands");
            program.submit(&commands, None, Some(READ)).expect("a submit");
            program.wait_for(READ).expect("the end");
            cast.finish().expect("all rays");
            drop(cast);
            let hits: Vec<Hit> = bytemuck::pod_collect_to_vec(&read(&program, hit_memory, 64 * size_of::<Hit>()));
            all_hits.push(hits);
            for (buffer, memory) in [(ray_buffer, ray_memory), (hit_buffer, hit_memory)] {
                program.device.destroy_buffer(buffer, None);
                program.device.free_memory(memory, None);
            }
            program.destroy();
        }
    }
    assert!(all_hits.iter().all(|hits| *hits == all_hits[0]), "the order changes nothing");
    assert!(all_hits[0].iter().any(|hit| hit.triangle_ix != NO_TRIANGLE), "some rays hit");
}

/// Makes a storage buffer that the host can write and read.
unsafe fn buffer(program: &Program, bytes: usize) -> (vk::Buffer, vk::DeviceMemory) {
    let on_host = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
    let info = vk::BufferCreateInfo::default().size(bytes as u64).usage(vk::BufferUsageFlags::STORAGE_BUFFER);
    // SAFETY: the memory is bound before the buffer is used.
    unsafe {
        let buffer = program.device.create_buffer(&info, None).expect("a buffer");
        let requirements = program.device.get_buffer_memory_requirements(buffer);
        let memory = program.allocate(&requirements, on_host).expect("memory");
        program.device.bind_buffer_memory(buffer, memory, 0).expect("bound memory");
        (buffer, memory)
    }
}

unsafe fn write(program: &Program, memory: vk::DeviceMemory, bytes: &[u8]) {
    // SAFETY: the device does not use the memory.
    unsafe {
        let mapped = program.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()).expect("a map");
        mapped.cast::<u8>().copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
        program.device.unmap_memory(memory);
    }
}

unsafe fn read(program: &Program, memory: vk::DeviceMemory, n_bytes: usize) -> Vec<u8> {
    // SAFETY: the device has written the memory, which is coherent.
    unsafe {
        let mapped = program.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty()).expect("a map");
        let bytes = std::slice::from_raw_parts(mapped.cast::<u8>(), n_bytes).to_vec();
        program.device.unmap_memory(memory);
        bytes
    }
}
