//! The compiled part of the Python package `kdray`: scenes, whose arrays `kdray/scene.py` has checked and laid out, and
//! the machine's devices.
//!
//! ```text
//! scene     the class `Core`: a lock, and what Python hands over
//!   state     geometries, the world that is made of them, casters
//!   columns   hits to the arrays of results
//!   watched  builds, of whose progress Python is told
//! pictures  the class `CoreScene`: a file that is rendered
//! process   the pools of threads, the devices, and the refusal of forked children
//! ```

mod columns;
mod pictures;
mod process;
mod scene;
mod state;
mod watched;

/// The compiled part of `kdray`. Its interface may change; use that of `kdray`.
#[pyo3::pymodule]
mod _kdray {
    #[pymodule_export]
    use super::{
        pictures::CoreScene,
        process::{devices, set_threads},
        scene::Core,
    };
}
