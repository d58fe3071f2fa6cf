//! kdray traces rays on any Vulkan driver, without ray tracing hardware: compute shaders traverse a kd-tree depth
//! first, with a bit mask as the stack. It implements Cao Jiayin's paper on interactive ray tracing by depth-first
//! kd-tree traversal (2010). A machine without Vulkan renders on the CPU.
//!
//! An [`Engine`](engine::Engine) opens a device, loads a scene and builds its tree, and renders pictures or casts rays:
//!
//! ```
//! use kdray::engine::{Engine, LoadRequest};
//! use kdray::scene::PictureChoices;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let engine = Engine::on_cpu(); // or Engine::open(&ContextOptions::default())?
//! let choices = PictureChoices { size: Some((64, 64)), ..PictureChoices::default() };
//! let loaded = engine.load("scenes/cornell.toml", &LoadRequest::pictures(choices))?;
//! let picture = engine.render(&loaded.world, &loaded.options)?.picture;
//! assert_eq!(picture.display.len(), 64 * 64); // sRGB, rows from the top
//! # Ok(())
//! # }
//! ```
//!
//! `examples/render.rs` and `examples/cast.rs` are complete programs.
//!
//! # Documents
//!
//! - [`documents::guide`]: scene files, rendering, layers, films, the viewer, casting rays, measuring.
//! - [`documents::python`]: the package for Python, beside Open3D and trimesh.
//! - [`documents::materials`]: the material model, light units, what MTL and glTF become, textures.
//! - [`documents::architecture`]: the way of the data; adding a pass, an array, a traversal, an acceleration
//!   structure.
//! - [`documents::performance`]: all figures, each with its machine and command.
//! - [`documents::experiments`]: what was tried, what it gave, what limits the traversal today.
//! - [`documents::conventions`]: how the code and its comments are written.
//!
//! # Features
//!
//! - `files`: scenes, images and rays from files, pictures and hits to files. Without it, programs hand over arrays
//!   ([`scene::Mesh`]).
//! - `cli`: the command `kdray`.
//! - `view`: windows, for `kdray view`.
//! - `bench`: measurements and their charts, for `kdray bench`.
//! - `shaderc-from-source`: the build compiles the GLSL compiler shaderc from its C++ source.
//!
//! The first four are on by default. A program that casts rays into its own arrays needs none of them.
//!
//! # Modules
//!
//! The modules, in the order in which data flows through them:
//!
//! ```text
//! scene    files -> triangles, materials, lights, camera
//! accel    triangles -> acceleration structure, through which rays find the triangles that they hit
//!   kdtree   the flat SAH kd-tree and its traversals
//! world    a scene with its acceleration structure
//! frame    options, picture and profile; scene, size, index of a sample -> the frame's constants
//! render   the frame: passes, barriers, batches -> picture
//!   passes   one kernel and one file each
//!   buffers  what kernels read and write
//!   gpu      the Vulkan layer, on which render, passes and buffers are built
//! cast     rays -> hits, without a frame
//! reference  every kernel in simple CPU code: the oracle of the tests
//! cpu      frames and casts without Vulkan, fast
//! engine   a device or the CPU: chooses the methods that the user leaves open, renders, casts
//! output   picture -> file
//! merge    files of parts -> picture
//! pack     a scene and all of its files -> one file
//! bench    all of it, timed
//! view     all of it, in a window
//!
//! layout   the structs that kernels and Rust share
//! util     names of enum variants, text that is safe to print, the host's memory
//! ```

#![deny(unsafe_code)]
#![warn(missing_docs)]

#[macro_use]
pub mod util;

#[doc(hidden)]
pub mod layout;

pub mod scene;

pub mod accel;

pub mod world;

pub mod frame;

#[doc(hidden)]
pub mod reference;

#[doc(hidden)]
pub mod cpu;

pub mod gpu;

#[doc(hidden)]
pub mod buffers;
#[doc(hidden)]
pub mod passes;
#[doc(hidden)]
pub mod render;

pub mod cast;

pub mod engine;

#[cfg(feature = "files")]
pub mod output;

#[cfg(feature = "files")]
pub mod merge;

#[cfg(feature = "files")]
pub mod pack;

#[cfg(feature = "bench")]
#[doc(hidden)]
pub mod bench;

#[cfg(feature = "view")]
#[doc(hidden)]
pub mod view;

/// The documents of the folder `docs`. They have no code.
#[cfg(doc)]
pub mod documents {
    #[doc = include_str!("../docs/guide.md")]
    pub mod guide {}
    #[doc = include_str!("../docs/python.md")]
    pub mod python {}
    #[doc = include_str!("../docs/materials.md")]
    pub mod materials {}
    #[doc = include_str!("../docs/architecture.md")]
    pub mod architecture {}
    #[doc = include_str!("../docs/performance.md")]
    pub mod performance {}
    #[doc = include_str!("../docs/experiments.md")]
    pub mod experiments {}
    #[doc = include_str!("../docs/conventions.md")]
    pub mod conventions {}
}

/// Compiles the example of README.md with the tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
