//! kdray: ray tracing by depth-first kd-tree traversal in Vulkan compute.
//!
//! The modules, in the order in which data flows through them:
//!
//! ```text
//! scene    files -> triangles, materials, lights, camera
//! accel    triangles -> acceleration structure: what leads rays to triangles
//!   kdtree   the flat SAH kd-tree and the ways of rays through it
//! world    a scene with its acceleration structure
//! frame    options, picture and profile; scene + size + sample -> the frame's constants
//! render   the frame: passes, barriers, batches -> picture
//!   passes   one kernel and one file each, on
//!   buffers  what kernels read and write, on
//!   gpu      the Vulkan layer
//! cast     rays -> hits, without a frame
//! cpu      both without Vulkan
//! engine   a device or the CPU: chooses what is left open, renders, casts
//! output   picture -> file
//! bench    all of it, timed
//! view     all of it, in a window
//!
//! layout   the structs that kernels and Rust share
//! util     names of variants, text that is safe to print, the host's memory
//! ```

#![deny(unsafe_code)]

#[macro_use]
pub mod util;

pub mod layout;

pub mod scene;

pub mod accel;

pub mod world;

pub mod frame;

pub mod cpu;

pub mod gpu;

pub mod buffers;
pub mod passes;
pub mod render;

pub mod cast;

pub mod engine;

pub mod output;

pub mod bench;

pub mod view;
