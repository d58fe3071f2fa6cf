//! kdray: ray tracing by depth-first kd-tree traversal in Vulkan compute.

#![deny(unsafe_code)]

pub mod camera;
pub mod cpu;
pub mod frame;
pub mod kdtree;
pub mod layout;
pub mod scene;
