//! Records a cast into the program's own command buffer, over the program's own buffers: kdray is a part of another
//! program's work on the device. Prints how many rays from the middle of the scene, in all directions, hit something.
//!
//! ```sh
//! cargo run --release --example record_cast -- scenes/cornell.toml
//! ```

#[path = "../own_device/program.rs"]
mod program;

use std::{env, error::Error, path::PathBuf};

use ash::vk;
use glam::Vec3;
use kdray::{
    accel::{Query, kdtree::Traversal},
    cast::{GpuCaster, Hit, NO_TRIANGLE, Ray},
    engine::{Engine, LoadRequest, Loaded, Opened, Work},
    gpu::{Device, ExternalBuffer, ExternalCommands},
};
use program::Program;

const N_RAYS: usize = 100_000;

fn main() -> Result<(), Box<dyn Error>> {
    let path = env::args_os().nth(1).map(PathBuf::from).ok_or("usage: record_cast SCENE")?;
    let opened = Opened::read(&path, &LoadRequest::rays(N_RAYS as u64))?;
    let (least, greatest) = opened.scene.bounds();
    let rays = rays((least + greatest) / 2.0);
    // SAFETY: the program destroys what it has made after kdray's objects are gone and the device is idle.
    unsafe {
        let program = Program::new()?;
        let buffers = Buffers::new(&program)?;
        buffers.write(&rays);
        cast(&program, &buffers, opened)?;
        let n_hits = buffers.hits().iter().filter(|hit| hit.triangle_ix != NO_TRIANGLE).count();
        println!("{n_hits} of {N_RAYS} rays hit something");
        buffers.destroy(&program);
        program.destroy();
    }
    Ok(())
}

/// Returns rays from a point in all directions, along a spiral.
fn rays(origin: Vec3) -> Vec<Ray> {
    let ray = |i: usize| {
        let height = 1.0 - (2 * i + 1) as f32 / N_RAYS as f32;
        let (sin, cos) = (2.4 * i as f32).sin_cos();
        let around = (1.0 - height * height).sqrt();
        Ray { origin, t_min: 0.0, direction: Vec3::new(around * cos, height, around * sin), t_max: f32::INFINITY }
    };
    (0..N_RAYS).map(ray).collect()
}

/// The value to which the timeline semaphore, initially 0, is set when the hits are written.
const WRITTEN: u64 = 1;

/// Casts the rays in a command buffer of the program.
unsafe fn cast(program: &Program, buffers: &Buffers, opened: Opened) -> Result<(), Box<dyn Error>> {
    // SAFETY: the handles are the program's, which lives longer than the device handle; it has one thread.
    let (device, [rays, hits]) = unsafe {
        let external = |ix: usize| ExternalBuffer::new(buffers.raw[ix], 0, SIZES[ix]);
        (Device::external(program.external())?, [0, 1].map(external))
    };
    let engine = Engine::on_device(&device);
    let (Loaded { world, .. }, _) = engine.build(opened, &Work::Rays(N_RAYS as u64))?;
    let mut caster = GpuCaster::new(&device, world.geometry(), Traversal::Mask)?;
    let cast = caster.recorded(rays, hits, Query::Closest)?;
    let record = |commands: vk::CommandBuffer| {
        // The cast needs no barrier before it: the submission makes the rays, which the host has written, visible.
        // SAFETY: the command buffer is being recorded.
        unsafe {
            cast.record(&ExternalCommands::new(commands));
            buffers.show_to_host(program, commands);
        }
    };
    // SAFETY: the cast and the buffers live until the device has run the commands.
    unsafe {
        let commands = program.record(record)?;
        program.submit(&commands, None, Some(WRITTEN))?;
        program.wait_for(WRITTEN)?;
    }
    // A few drivers end loops after a number of iterations. Rays that stopped at that limit are finished here.
    cast.finish()?;
    Ok(())
}

/// Sizes of the rays and of the hits in bytes.
const SIZES: [u64; 2] = [(N_RAYS * size_of::<Ray>()) as u64, (N_RAYS * size_of::<Hit>()) as u64];

/// Two buffers that the host writes and reads: rays and hits.
struct Buffers {
    raw: [vk::Buffer; 2],
    memory: [vk::DeviceMemory; 2],
    mapped: [*mut u8; 2],
}

impl Buffers {
    unsafe fn new(program: &Program) -> Result<Self, Box<dyn Error>> {
        let on_host = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let device = &program.device;
        let mut made = Self { raw: Default::default(), memory: Default::default(), mapped: [std::ptr::null_mut(); 2] };
        for (ix, size) in SIZES.into_iter().enumerate() {
            let info = vk::BufferCreateInfo::default().size(size).usage(vk::BufferUsageFlags::STORAGE_BUFFER);
            // SAFETY: the memory is bound before the buffer is used, and stays mapped until it is freed.
            unsafe {
                made.raw[ix] = device.create_buffer(&info, None)?;
                made.memory[ix] = program.allocate(&device.get_buffer_memory_requirements(made.raw[ix]), on_host)?;
                device.bind_buffer_memory(made.raw[ix], made.memory[ix], 0)?;
                made.mapped[ix] = device.map_memory(made.memory[ix], 0, size, vk::MemoryMapFlags::empty())?.cast();
            }
        }
        Ok(made)
    }

    unsafe fn write(&self, rays: &[Ray]) {
        let bytes: &[u8] = bytemuck::cast_slice(rays);
        // SAFETY: the memory is mapped, and the device does not use it yet.
        unsafe { self.mapped[0].copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
    }

    unsafe fn hits(&self) -> Vec<Hit> {
        // SAFETY: the memory is mapped, and the device has written it.
        let bytes = unsafe { std::slice::from_raw_parts(self.mapped[1], SIZES[1] as usize) };
        bytemuck::pod_collect_to_vec(bytes)
    }

    /// Records the barrier between the cast and reads by the host.
    unsafe fn show_to_host(&self, program: &Program, commands: vk::CommandBuffer) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COMPUTE_SHADER)
            .src_access_mask(vk::AccessFlags2::SHADER_STORAGE_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        let info = vk::DependencyInfo::default().memory_barriers(&barrier);
        // SAFETY: the commands are being recorded.
        unsafe { program.device.cmd_pipeline_barrier2(commands, &info) };
    }

    unsafe fn destroy(self, program: &Program) {
        // SAFETY: the program has waited for the device.
        unsafe {
            self.raw.into_iter().for_each(|buffer| program.device.destroy_buffer(buffer, None));
            self.memory.into_iter().for_each(|memory| program.device.free_memory(memory, None));
        }
    }
}
