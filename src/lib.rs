//! kdray: ray tracing by depth-first kd-tree traversal in Vulkan compute.
//!
//! The modules, in the order in which data flows through them:
//!
//! ```text
//! scene    files -> triangles, materials, lights, camera
//! kdtree   triangles -> flat SAH kd-tree
//! camera   scene + size + sample -> the frame's constants
//! render   the frame: passes, barriers, batches -> picture
//!   passes   one kernel and one file each, on
//!   gpu      the Vulkan layer
//! cast     rays -> hits, without a frame
//! choices  what the user leaves open: which tree, which traversal, which primary rays
//! cpu      both without Vulkan
//! profile  times and counts -> each pass's rays
//! output   picture -> file
//! memory   what there is of it
//! bench    all of it, timed
//! view     all of it, in a window
//! ```

#![deny(unsafe_code)]

#[macro_use]
mod words;

mod bounce;
pub mod frame;
pub mod layout;
mod profile;

pub mod scene;

pub mod kdtree;

pub mod camera;
pub mod sampling;

pub mod cpu;

pub mod gpu;
pub mod passes;
pub mod render;

pub mod cast;

pub mod choices;
pub mod memory;

pub mod output;
pub mod text;

pub mod bench;

pub mod view;
