//! kdray: ray tracing by depth-first kd-tree traversal in Vulkan compute.

#![deny(unsafe_code)]

pub mod frame;
pub mod layout;
pub mod output;
